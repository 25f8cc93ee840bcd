"""From a scene to equations on a grid: plane, effects, knots, and the constraints of grasps."""
