"""What the choices of the space discretisation are worth: `python -m benchmarks.choices`.

The final worst error of a march on the paper's case, against the converged motion, as the solver is and with one choice
undone: the quadrature of the stretch energy, and the knots.
"""

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1", VECLIB_MAXIMUM_THREADS="1")

from collections.abc import Callable
from itertools import product
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks.machine import machine_line
from benchmarks.paper_case import errors, paper_scene, reference
from dlocore import Quality, discretisation, predict
from dlocore.kernels.basis import GAUSS_1, GAUSS_2, basis_rows, build_tables, graded_knots
from dlocore.spline import uniform_knots

GRIDS = ((9, 13), (13, 19), (17, 25))
CASES = tuple(product((1e-2, 1e-3), (0.0, 0.25, 0.5, 0.8)))  # EI [N m^2], grasp [m]


def stretch_points(rule: tuple[Any, Any]) -> Callable[..., Any]:
    """Return a `build_tables` with the same Gauss rule for the stretch in every span."""

    def build(knots: Any, *arguments: Any) -> Any:
        spans = np.unique(knots)
        half = 0.5 * np.diff(spans)
        u = (spans[:-1, None] + half[:, None] * (1.0 + rule[0])).ravel()
        first, table = basis_rows(knots, u, 1)
        rows = {"axial_first": first, "axial_b1": np.ascontiguousarray(table[:, 1])}
        return build_tables(knots, *arguments)._replace(**rows, axial_w=(half[:, None] * rule[1]).ravel())

    return build


def uniform(n: int, length: float, *arguments: Any) -> Any:
    """Return uniform knots, whatever is grasped."""
    return uniform_knots(n, length)


def ungraded(n: int, length: float, features: Any, multiplicity: Any, power: Any, width: Any) -> Any:
    """Return knots at the grasps, but not graded towards them."""
    return graded_knots(n, length, features, multiplicity, np.zeros_like(power), width)


CHOICES: dict[str, dict[str, Any]] = {
    "as it is": {},
    "stretch: 1 point in every span": {"build_tables": stretch_points(GAUSS_1)},
    "stretch: 2 points in every span": {"build_tables": stretch_points(GAUSS_2)},
    "knots: at the grasp, not graded": {"graded_knots": ungraded},
    "knots: uniform": {"graded_knots": uniform},
}


def main() -> None:
    truths = {case: reference(paper_scene(*case, Quality()))[0] for case in CASES}
    print(f"{'final worst error [mm], median and largest of 8 cases':34}")
    print(f"{'':34}" + "".join(f"{f'{n_u} x {n_t}':>18}" for n_u, n_t in GRIDS))
    for name, changes in CHOICES.items():
        cells = []
        for n_u, n_t in GRIDS:
            quality = Quality(n_u=n_u, n_t=n_t, method="march", estimate=False)
            with patch.multiple(discretisation, **changes) if changes else patch.dict({}):
                motions = {case: predict(paper_scene(*case, quality)) for case in CASES}
            worst = [1e3 * errors(m.surface.sample()[2][..., :3], truths[c])["final"] for c, m in motions.items()]
            cells.append(f"{np.median(worst):9.2f}{max(worst):9.2f}")
        print(f"{name:34}" + "".join(cells))
    print(machine_line())


if __name__ == "__main__":
    main()
