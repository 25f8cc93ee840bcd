"""Grids for an asked error or time: refined until two agree, and what takes the place of one that fails."""
