"""Other simulators on the same cases in the same run: `python -m benchmarks.peers [--json FILE] [--plot FILE]`.

Needs `pip install .[peers]` for MuJoCo and PyElastica; what is not installed is left out and said so. Every peer's
settings are searched for the fastest that keep the largest error over the motion below 10, 3, 1 and 0.3 mm; the
winners are timed again, medians of processor time, one thread, set-up apart. docs/peers.md tells how each is set up.
"""

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1", VECLIB_MAXIMUM_THREADS="1")

import argparse
import json
import warnings
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from benchmarks.machine import machine, machine_line
from benchmarks.peers.cases import Case, all_cases
from benchmarks.peers.cosserat import Cosserat
from benchmarks.peers.explicit import ExplicitRod
from benchmarks.peers.mujoco_chain import Chain
from benchmarks.peers.mujoco_flex import Flex
from benchmarks.peers.ours import Asked, Spline
from benchmarks.peers.report import Results
from benchmarks.peers.search import TOLERANCES, Peer, best, measure, search
from dlocore import warm_up

PEERS: tuple[tuple[Peer, str], ...] = (  # with the package each needs
    (Spline("march", 8.0), "numpy"),
    (Spline("spacetime", 16.0), "numpy"),
    (Asked(), "numpy"),
    (ExplicitRod(), "numpy"),
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


def compare(results: Results, peers: list[Peer], case: Case, repeats: int, patience: float) -> None:
    """Search all peers on a case, and time the winners again."""
    for peer in peers:
        trials = search(peer, case, patience)
        results.trials += trials
        if not trials:
            results.impossible.add((case.name, peer.name))
        again = {}
        for tolerance in TOLERANCES:
            # who asks for an error gets what was asked for, not the best of all that might have been
            asked = [t for t in trials if t.setting.get("target_error", tolerance) == tolerance]
            winner = best(asked, tolerance)
            if winner is not None:
                key = str(winner.setting)
                if key not in again:
                    again[key] = measure(peer, case, winner.setting, repeats=repeats)
                results.winners[case.name, peer.name, tolerance] = again[key]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", default="", help="only cases whose name contains this")
    parser.add_argument("--repeats", type=int, default=25, help="timed calls of each winner, at most (default 25)")
    parser.add_argument("--budget", type=float, default=1.0, help="factor on the time of the searches (default 1)")
    parser.add_argument("--json", type=Path, help="file for every trial")
    parser.add_argument("--plot", type=Path, help="file for the work-precision diagram (needs matplotlib)")
    options = parser.parse_args()
    warnings.filterwarnings("ignore", category=RuntimeWarning)  # of simulations that blow up: their error is infinite
    versions = {package: installed(package) for _, package in PEERS}
    peers = [peer for peer, package in PEERS if versions[package] is not None]
    for peer, package in PEERS:
        if versions[package] is None:
            print(f"{peer.name} is left out: {package} is not installed (pip install .[peers])")
    warm_up()
    results = Results([], [peer.name for peer in peers])
    cases = []
    for case in all_cases(options.cases):
        if not cases or case.family != cases[-1].family:
            compile_all(peers, case)
        cases.append(case)
        results.families[case.name] = case.family
        compare(results, peers, case, options.repeats, options.budget)
        print(f"{case.name}: done, reference within {1e3 * case.uncertainty:.3f} mm", flush=True)
    line = f"{machine_line()}, budget {options.budget:g}; " + ", ".join(f"{p} {v}" for p, v in versions.items() if v)
    print()
    print("Processor time and ratio to the faster of dlocore's two methods, medians; largest error over the motion")
    print()
    print(results.table(families=False))
    print()
    print("Medians over the cases of a family")
    print()
    print(results.table(families=True))
    print()
    print("\n".join([*results.wins(), line]))
    if options.json:
        content = {
            "machine": machine(),
            "versions": versions,
            "cases": [{k: getattr(c, k) for k in ("name", "family", "uncertainty", "check")} for c in cases],
            "winners": [{"tolerance": k[2]} | asdict(t) for k, t in results.winners.items()],
            "trials": [asdict(t) for t in results.trials],
        }
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps(content, indent=1))
    if options.plot:
        results.plot(options.plot, f"python -m benchmarks.peers; {line}")


if __name__ == "__main__":
    main()
