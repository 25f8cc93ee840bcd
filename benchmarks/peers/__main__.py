"""Other simulators on the same cases in the same run: `python -m benchmarks.peers [--publish]`.

Needs `pip install .[peers]` for MuJoCo and PyElastica; what is not installed is left out and said so. Every peer's
settings are searched for the fastest that keep the largest error over the motion below 10, 3, 1 and 0.3 mm; the
winners are timed again, medians of processor time, one thread, set-up apart. docs/peers.md tells how each is set up.
"""

import argparse
import json
import math
import warnings
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from benchmarks.machine import machine
from benchmarks.peers.cases import Case, all_cases
from benchmarks.peers.cosserat import Cosserat
from benchmarks.peers.explicit import ExplicitRod
from benchmarks.peers.mujoco_chain import Chain
from benchmarks.peers.mujoco_flex import Flex
from benchmarks.peers.ours import Asked, Spline
from benchmarks.peers.report import Results
from benchmarks.peers.search import TOLERANCES, Peer, Trial, best, measure, search
from dlocore import warm_up

DOCS = Path(__file__).parents[2] / "docs"
CHECKED = ("name", "family", "uncertainty", "check", "stretch")
Stored = dict[str, Any]
PEERS: tuple[tuple[Peer, str | None], ...] = (  # with the package each needs
    (Spline("march", 8.0), None),
    (Spline("spacetime", 16.0), None),
    (Asked(), None),
    (ExplicitRod(), None),
    (Chain(), "mujoco-core"),
    (Flex(), "mujoco-core"),
    (Cosserat(), "pyelastica"),
)


def installed(package: str) -> str | None:
    """Return the version of a package, None where it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def compile_all(peers: list[Peer], case: Case) -> None:
    """Run every peer once on a case with its coarsest settings, so that no later time contains a compilation."""
    for peer in peers:
        knobs = peer.knobs(case)
        if knobs:
            words = {n: v for n, v in knobs.items() if isinstance(v[0], str)}
            coarse = {n: v[0] for n, v in knobs.items()}
            for word in next(iter(words.values()), (None,)):
                measure(peer, case, coarse if word is None else coarse | {next(iter(words)): word})


def compare(peers: list[Peer], case: Case, repeats: int, patience: float) -> tuple[list[Stored], list[Stored]]:
    """Search all peers on a case, and time the winners again; all trials, and the winners with their tolerances."""
    trials: list[Stored] = []
    winners: list[Stored] = []
    for peer in peers:
        found = search(peer, case, patience)
        trials += [stored(t) for t in found]
        again: dict[str, Stored] = {}
        for tolerance in TOLERANCES:
            # who asks for an error gets what was asked for, not the best of all that might have been
            asked = [t for t in found if t.setting.get("target_error", tolerance) == tolerance]
            winner = best(asked, tolerance)
            if winner is None:
                continue
            key = str(winner.setting)
            if key not in again:
                again[key] = stored(measure(peer, case, winner.setting, repeats=repeats))
            winners.append({"tolerance": tolerance} | again[key])
    return trials, winners


def stored(trial: Trial) -> Stored:
    """Return a trial for JSON, which knows no infinity."""
    return {k: None if v == math.inf else v for k, v in asdict(trial).items()}


def run(wanted: str, repeats: int, patience: float, file: Path | None) -> dict[str, Any]:
    """Compare on all cases whose name contains `wanted`; what is stored, in `file` after every case."""
    versions = {package: installed(package) for _, package in PEERS if package is not None}
    peers = [peer for peer, package in PEERS if package is None or versions[package] is not None]
    for peer, package in PEERS:
        if peer not in peers:
            print(f"{peer.name} is left out: {package} is not installed (pip install .[peers])")
    warm_up()
    content: dict[str, Any] = {"machine": machine(), "versions": versions, "budget": patience}
    content |= {"peers": [peer.name for peer in peers], "cases": [], "winners": [], "trials": []}
    for case in all_cases(wanted):
        if case.family not in [c["family"] for c in content["cases"]]:
            compile_all(peers, case)
        content["cases"].append({k: getattr(case, k) for k in CHECKED})
        trials, winners = compare(peers, case, repeats, patience)
        content["trials"] += trials
        content["winners"] += winners
        if file:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(json.dumps(content, indent=1))
        print(f"{case.name}: done", flush=True)
    return content


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", default="", help="only cases whose name contains this")
    parser.add_argument("--repeats", type=int, default=25, help="timed calls of each winner, at most (default 25)")
    parser.add_argument("--budget", type=float, default=1.0, help="factor on the time of the searches (default 1)")
    parser.add_argument("--json", type=Path, help="file to write everything to, case by case")
    parser.add_argument("--read", type=Path, help="report what such a file holds, and measure nothing")
    parser.add_argument("--plot", type=Path, help="file for the work-precision diagram (needs matplotlib)")
    parser.add_argument("--publish", action="store_true", help="write tables and plot into docs/ (needs matplotlib)")
    options = parser.parse_args()
    warnings.filterwarnings("ignore", category=RuntimeWarning)  # of simulations that blow up: their error is infinite
    if options.read:
        content = json.loads(options.read.read_text())
    else:
        content = run(options.cases, options.repeats, options.budget, options.json)
    if not content["cases"]:
        parser.error(f"no case has {options.cases!r} in its name")
    results = Results(content)
    print()
    print("Processor time and its ratio to the faster of dlocore's two methods; largest error over the motion")
    print()
    print(results.table(families=False))
    print()
    print("Medians over the cases of a family")
    print()
    print(results.text())
    if options.plot:
        results.plot(options.plot)
    if options.publish:
        results.publish(DOCS / "peers.md", DOCS / "peers.png")


if __name__ == "__main__":
    main()
