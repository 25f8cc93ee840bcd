"""Start shapes: curves, and their fit to points, in order or as an unordered cloud."""
