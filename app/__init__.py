"""The service around the predictor: HTTP, stored runs, recordings, the 3D scene and the command line.

A solve uses one core, and several workers run at the same time, so the linear algebra libraries must not start threads
of their own. They read these variables once, when NumPy is first imported.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
