"""Identify a simulated cable while its frames arrive at 30 Hz: `python -m benchmarks.online`.

Prints the processor time of an update, and how the estimate approaches the truth from a cable three times too stiff.
"""

import argparse
from dataclasses import replace
from time import process_time
from typing import cast

import numpy as np
from numpy.typing import NDArray

from benchmarks.machine import machine_line
from benchmarks.simulated_recordings import RATE, simulated, true_cable
from dlocore import Environment
from dlocore.identify.online import Identifier

FRAME = 1.0 / 30.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=10.0, help="recorded time")
    parser.add_argument("--seed", type=int, default=100)
    options = parser.parse_args()
    print(machine_line())
    recording = simulated(options.seed, options.seconds)
    cable, environment = true_cable(np.random.default_rng([options.seed, 1]))
    truth = cast(float, cable.bending_stiffness)
    times = cast(NDArray[np.float64], recording.times)
    markers = cast(NDArray[np.float64], recording.markers)
    wrong = replace(cable, bending_stiffness=3.0 * truth)
    identifier = Identifier(recording.u, recording.held, wrong, Environment(drag=environment.drag))
    spent, skipped = [], 0
    step = round(FRAME * RATE)
    for frame, k in enumerate(range(0, len(times), step)):
        identifier.add(float(times[k]), markers[k])
        began = process_time()
        update = identifier.update()
        if update is None:
            skipped += 1
            continue
        spent.append(1e3 * (process_time() - began))
        if frame % 30 == 0:
            print(f"{times[k]:5.1f} s  EI {update.values['bending_stiffness'] / truth:5.2f} of the truth, "
                  f"known to {update.deviations['bending_stiffness']:.0%}, {1e3 * update.distance:.1f} mm")  # fmt: skip
    print(
        f"\nupdates: {len(spent)}, without one: {skipped}; processor time median {np.median(spent):.1f} ms, "
        f"95 % below {np.quantile(spent, 0.95):.1f} ms; a frame takes {1e3 * FRAME:.1f} ms"
    )


if __name__ == "__main__":
    main()
