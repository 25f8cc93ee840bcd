"""Compiled inner loops: basis tables, banded factorisation, assembly, the march and the least squares."""
