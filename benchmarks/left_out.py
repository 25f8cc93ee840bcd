"""What the automatic choice of effects leaves out: `python -m benchmarks.left_out --seed 40 --count 200`.

Random scenes, drawn as by `benchmarks.random_scenes` but with quality "auto" and all effects "auto", are solved as they
are, and again with each effect that was left out switched on, one at a time. A scene is printed if this moves it by
more than twice the two error estimates and by more than 0.1 % of the length: there the choice was wrong and did not say
so. Answers that report crossing strands are skipped. `--index 17` runs only scene 17.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from benchmarks.machine import machine_line
from benchmarks.pairs import Pair, drawn, indices, paired, scenes_parser, solved

DEADLINE = 15.0  # [s]
MATTERS = 1e-3  # of the length
CROSSED = "strands cross"  # words of an answer that tells of strands that go through each other


class LeftOut(NamedTuple):
    """An effect that was left out, why, and the motions without and with it."""

    effect: str
    reason: str
    pair: Pair

    @property
    def is_told(self) -> bool:
        """Whether the two are as near as they tell."""
        return self.pair.is_told or self.pair.apart <= MATTERS


def switch_on(seed: int, index: int) -> Iterator[LeftOut]:
    """Yield what each effect does that was left out of the scene of a seed and an index."""
    one = drawn(seed, index)
    if one is None:
        return
    one = one._replace(scene=replace(one.scene, effects={}))
    found = solved(one.scene, DEADLINE)
    if found is None or CROSSED in found.message:
        return
    for effect in found.effects:
        if effect.active:
            continue
        whole = solved(replace(one.scene, effects={effect.name: "on"}), DEADLINE)
        if whole is not None and next(e.active for e in whole.effects if e.name == effect.name):
            yield LeftOut(effect.name, effect.reason, paired(one, found, whole))


def main() -> None:
    options = scenes_parser(__doc__, 200).parse_args()
    seen: Counter[str] = Counter()
    wrong: Counter[str] = Counter()
    for index in indices(options):
        for one in switch_on(options.seed, index):
            seen[one.effect] += 1
            if not one.is_told:
                wrong[one.effect] += 1
                print(f"{one.effect} ({one.reason}): {one.pair.line()}", flush=True)
    print("| left out | times | moves it by more than is told |")
    print("|---|---|---|")
    for effect, count in sorted(seen.items()):
        print(f"| {effect} | {count} | {wrong[effect]} |")
    print(machine_line())


if __name__ == "__main__":
    main()
