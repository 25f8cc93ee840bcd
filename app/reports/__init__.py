"""What an identification and a validation say, as pages and plots."""
