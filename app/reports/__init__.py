"""Results of identifications and validations, as pages and plots."""
