"""The solvers behind `predict`, all returning the same bivariate spline."""
