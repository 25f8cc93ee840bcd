"""What accuracy costs in time: measured errors and times over scenes, grids, methods and effects."""
