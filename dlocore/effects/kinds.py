"""Kinds of obstacles: the first number of the row that `distance.py` reads.

They stand apart from the compiled code, so that scenes can be made without the compiler, and in this folder, as numba
freezes them into its cache, which follows the sources here.
"""

SPHERE, CAPSULE, CYLINDER, BOX = range(4)
