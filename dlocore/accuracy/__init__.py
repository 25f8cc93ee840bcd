"""Grids for a requested error or time: refined until two agree, and the fallbacks if a grid fails."""
