"""`method="reference"`: an adaptive, error-controlled simulation of a discrete elastic rod, step by step.

It judges the other methods, so it shares no solver code with them: neither their splines in u nor their quadrature,
their effects' laws, their steps or their linear algebra. It reads the posed scene (`dlocore.problem.problem`), and
answers with an ordinary `Prediction`. docs/reference.md says what it computes.
"""
