"""Studies and the independent judge of the solver; run from a checkout, not part of the installed package.

Linear algebra runs on one thread in all of them. Its libraries read these variables once, when NumPy is first imported.
"""

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1", VECLIB_MAXIMUM_THREADS="1")
