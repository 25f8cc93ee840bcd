"""Identify simulated cables that are tracked badly, over seeded trials: `python -m benchmarks.identification`.

Each trial draws a cable and its drag within a factor of three, and hangs the cable between two grippers that swing
together and slightly against each other. It is tracked at 200 Hz by nine markers on the cable and two on each gripper,
5 cm apart. All have 1 mm of noise; 5 % are outliers of 5 cm, and 10 % are lost. Nothing else shows where the grippers
are. The truth is marched with half the time step of the replays, on a net of as many control points, or of more
(`--truth`).
"""

import argparse
from time import process_time

import numpy as np

from benchmarks.machine import machine_line
from benchmarks.simulated_recordings import simulated, true_cable
from dlocore.identify import Resolution, identify

NAMES = ("bending_stiffness", "drag", "bending_damping")
WITHIN = 0.05
N_U = 17  # control points of the replays


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=50)
    parser.add_argument("--first", type=int, default=100, help="first seed")
    parser.add_argument("--seconds", type=float, default=10.0, help="recorded time of each trial")
    parser.add_argument("--truth", type=int, default=N_U, help="control points of the simulated cable")
    options = parser.parse_args()
    print(machine_line())
    near, inside, errors, spent = [], [], [], []
    for seed in range(options.first, options.first + options.trials):
        cable, environment = true_cable(np.random.default_rng([seed, 1]))
        truth = np.array([cable.bending_stiffness, environment.drag, cable.bending_damping], dtype=float)
        recording = simulated(seed, options.seconds, n_u=options.truth)
        began = process_time()
        found = identify([recording], names=NAMES, resolution=Resolution(n_u=N_U))
        spent.append(process_time() - began)
        error = np.array([p.value for p in found.parameters]) / truth - 1.0
        errors.append(error)
        near.append(np.abs(error) <= WITHIN)
        inside.append([p.low <= true <= p.high for p, true in zip(found.parameters, truth, strict=True)])
        each = zip(NAMES, error, inside[-1], strict=True)
        line = "  ".join(f"{n} {e:+.1%}{'' if i else ' (outside)'}" for n, e, i in each)
        print(f"{seed}  {line}", flush=True)
    both = np.array(near) & np.array(inside)
    print(f"\n{'parameter':<20}{'within 5 %':>12}{'in interval':>12}{'median error':>14}{'worst':>8}")
    for j, name in enumerate(NAMES):
        column = np.abs(np.array(errors)[:, j])
        share = [float(np.mean(np.array(x)[:, j])) for x in (near, inside)]
        print(f"{name:<20}{share[0]:>12.0%}{share[1]:>12.0%}{np.median(column):>14.1%}{column.max():>8.1%}")
    print(f"\nall within 5 % and inside their intervals: {both.all(axis=1).mean():.0%} of {options.trials} trials")
    print(f"processor time of an identification: median {np.median(spent):.1f} s")


if __name__ == "__main__":
    main()
