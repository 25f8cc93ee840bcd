"""Kinds of obstacles: the first number of each row that `distance.py` reads.

They are apart from the compiled code, so that scenes can be made without loading the compiler. They are in this folder
because numba freezes them into its cached code, and the cache follows the sources in this folder.
"""

SPHERE, CAPSULE, CYLINDER, BOX = range(4)
