"""Named hard cases, by what is hard about them."""

from benchmarks.hard.cases import effects, geometry, motion, numbers, stiffness
from benchmarks.hard.cases.base import CASES, TARGET, Case, posed

__all__ = ["CASES", "TARGET", "Case", "effects", "geometry", "motion", "numbers", "posed", "stiffness"]
