"""Random hard scenes against the step-by-step reference: `python -m benchmarks.random_reference --seed 1 --count 400`.

Scenes as `benchmarks.random_scenes` draws them, with quality "auto" and without self-contact, which the reference does
not have. The scenes that both solve within their deadlines are counted. A scene is printed if the largest distance
between the two anywhere is more than twice the two error estimates. `--index 17` runs only scene 17.
"""

import multiprocessing
from collections.abc import Iterable
from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks.machine import machine_line
from benchmarks.pairs import Pair, drawn, indices, paired, scenes_parser, solved
from dlocore import Quality, warm_up

TARGET = 3e-3  # of the length: that of the reference
DEADLINES = 10.0, 15.0  # [s] of the predictor and the reference
PATIENT = 300.0, 300.0  # [s]: the same where what is found must not depend on the machine
WRONG = 1e-2  # of the length


def compare(seed: int, index: int, deadlines: tuple[float, float] = DEADLINES) -> Pair | None:
    """Compare the scene of a seed and an index, None where it can't be followed or one of the two does not solve it."""
    one = drawn(seed, index)
    if one is None:
        return None
    scene = replace(one.scene, effects={**one.scene.effects, "self_contact": "off"})
    found = solved(scene, deadlines[0])
    if found is None:
        return None
    quality = Quality(method="reference", target_error=max(TARGET * scene.cable.length, 1e-6))
    reference = solved(replace(scene, quality=quality), deadlines[1])
    return None if reference is None else paired(one._replace(scene=scene), found, reference)


def report(results: Iterable[Pair | None]) -> None:
    """Print the scenes whose distance the estimates do not tell of as they come, and then how many there are."""
    seen = []
    for one in results:
        if one is None:
            continue
        seen.append(one)
        if not one.is_told:
            print(one.line(), flush=True)
    if not seen:
        print("none that both solve")
        return
    near = sum(one.apart <= WRONG for one in seen)
    print(f"{len(seen)} scenes that both solve; {near} within {WRONG:.0%} of the length")
    print(f"within twice the sum of both estimates: {sum(one.is_told for one in seen)}")
    wrong = [one.index for one in seen if one.apart > WRONG and not one.is_told]
    print(f"beyond {WRONG:.0%} of the length, and not told: {wrong or 'none'}")
    print(f"median distance {np.median([one.apart for one in seen]):.2%} of the length")


def main() -> None:
    parser = scenes_parser(__doc__, 400)
    parser.add_argument("--jobs", type=int, default=1, help="processes (default 1)")
    options = parser.parse_args()
    with multiprocessing.get_context("spawn").Pool(options.jobs, warm_up) as pool:
        report(pool.imap(partial(compare, options.seed), indices(options)))
    print(machine_line())


if __name__ == "__main__":
    main()
