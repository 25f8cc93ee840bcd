"""Studies and the independent judge of the solver; run from a checkout, not part of the installed package."""
