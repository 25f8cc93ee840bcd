"""`method="reference"`: an adaptive, error-controlled simulation of a discrete elastic rod, step by step.

It judges the other methods, so it shares no solver code with them: not their splines in u, their quadrature, the laws
of their effects, their steps or their linear algebra. It reads the posed scene (`dlocore.problem.problem`) and returns
an ordinary `Prediction`. The other methods decide only whether a motion leaves its plane (`levels/whole_march.py`),
whether a gripper closes beside the cable (`levels/driven.py`), whether and to which side a start at rest is tipped
(`statics/tipping.py`), and what counts as undetermined (`stability/determined.py`). docs/reference.md says what it
computes.
"""
