"""The effect of axial damping on motions: `python -m benchmarks.axial_damping [NAME ...]`.

Every scene of the catalogue, the paper's cases, and random scenes that did not converge without axial damping are
solved three times to a thousandth of the length: with the default damping (docs/model.md eq. 7a), without damping, and
with a hundred times the axial stiffness, which is as close as possible to a cable that does not stretch at all. Each
row gives how far these motions are apart, as shares of the length, and the error estimate of each.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from benchmarks.catalogue import catalogue
from benchmarks.hard.generator import draw
from benchmarks.machine import machine_line
from benchmarks.peers.cases import planar
from dlocore import Cable, Prediction, Quality, Scene, predict, warm_up

TARGET = 1e-3  # of the length
DEADLINE = 20.0  # [s] for one motion
STIFFER = 100.0
AFTER_A_JUMP = ((2, 11), (2, 80), (2, 82), (2, 101), (2, 132), (2, 160))  # (seed, index) of the random scenes


@dataclass(frozen=True, kw_only=True)
class Row:
    """Distances of the motions of one scene, and the error each is estimated to have, in parts of the length.

    Attributes:
        changed: between the damped and the undamped motion.
        damped, undamped: of each to the hundred times stiffer one.
        errors: estimates of the three, in this order; None where it did not converge.
    """

    scene: str
    changed: float
    damped: float
    undamped: float
    errors: tuple[float | None, float | None, float | None]

    def __str__(self) -> str:
        errors = ", ".join("-" if e is None else f"{e:.1e}" for e in self.errors)
        return f"| {self.scene} | {self.changed:.1e} | {self.damped:.1e} | {self.undamped:.1e} | {errors} |"


def scenes() -> Iterator[tuple[str, Scene]]:
    """Yield the scenes by name."""
    for grasp in (0.0, 0.25):
        for bending in (1e-4, 1e-3, 1e-2):
            scene = planar(bending, grasp)
            yield f"paper, EI {bending:g}, grasp {grasp:g} m", replace(scene, cable=damped(scene.cable, 1.0))
    yield from catalogue().items()
    for seed, index in AFTER_A_JUMP:
        yield f"random {seed}:{index}", draw(seed, index).make()


def damped(cable: Cable, stiffer: float) -> Cable:
    """Return the cable with so many times its axial stiffness, and the damping that goes with it by eq. 7a."""
    return replace(cable, axial_stiffness=stiffer * cast(float, cable.axial_stiffness), axial_damping=None)


def compare(name: str, scene: Scene) -> Row:
    """Solve a scene with, without, and nearly without stretch."""
    cable = scene.cable
    cables = (damped(cable, 1.0), replace(cable, axial_damping=0.0), damped(cable, STIFFER))
    quality = Quality(target_error=TARGET * cable.length)
    soft, bare, stiff = (predict(replace(scene, cable=c, quality=quality), deadline=DEADLINE) for c in cables)
    return Row(
        scene=name,
        changed=apart(soft, bare),
        damped=apart(soft, stiff),
        undamped=apart(bare, stiff),
        errors=(told(soft), told(bare), told(stiff)),
    )


def apart(a: Prediction, b: Prediction) -> float:
    """Return the largest distance of two motions, in parts of the length."""
    u, t = np.linspace(0.0, a.surface.length, 101), np.linspace(0.0, a.surface.horizon, 65)
    away = np.linalg.norm(a.surface.positions(u, t) - b.surface.positions(u, t), axis=-1)
    return float(away.max() / a.surface.length)


def told(prediction: Prediction) -> float | None:
    """Return the estimated error in parts of the length; None where the motion did not converge."""
    estimate = prediction.accuracy.error_estimate
    return None if prediction.status != "converged" or estimate is None else estimate / prediction.surface.length


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="parts of the names of scenes; none: all")
    names = parser.parse_args().names
    warm_up()
    print("| scene | damped to undamped | damped to stiff | undamped to stiff | estimated errors of the three |")
    print("|---|---|---|---|---|")
    changes = []
    for name, scene in scenes():
        if names and not any(part in name for part in names):
            continue
        row = compare(name, scene)
        print(row, flush=True)
        if row.errors[0] is not None and row.errors[1] is not None:
            changes.append(row.changed)
    if changes:
        quantiles = np.quantile(changes, [0.5, 0.9, 1.0])
        print(f"both converged: {len(changes)}; median, 90 %, worst change:", *(f"{q:.1e}" for q in quantiles))
    print(machine_line())


if __name__ == "__main__":
    main()
