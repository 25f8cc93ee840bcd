"""The tables and the plot of a comparison, from its trials."""

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.peers.search import TOLERANCES, Trial, best

OURS = ("dlocore march", "dlocore spacetime")  # the ratios are to the faster of the two
FINE = np.geomspace(2e-2, 1e-4, 24)  # [m]: tolerances of the plot's curves
HEADLINE = 1e-3  # [m]
OFF_THE_SHELF = 10.0  # times as fast as a peer is what dlocore is meant to be ...
ASKED = {"explicit rod": 2.0}  # ... but for these
SHORT = 1e-4  # [s]: a set-up below it is none
MARKS = ("<!-- results -->", "<!-- end of results -->")
COLOURS = {  # Okabe-Ito
    "dlocore march": "#0072B2",
    "dlocore spacetime": "#56B4E9",
    "dlocore target_error": "#009E73",
    "explicit rod": "#D55E00",
    "MuJoCo chain": "#E69F00",
    "MuJoCo flex": "#CC79A7",
    "PyElastica": "#000000",
}


class Results:
    """What a comparison found, as it is stored: all trials of all peers, and the repeated timings of the winners."""

    def __init__(self, content: dict[str, Any]) -> None:
        self.families: dict[str, str] = {case["name"]: case["family"] for case in content["cases"]}
        self.names: list[str] = content["peers"]
        self.trials = [Trial(**_read(t)) for t in content["trials"]]
        self.winners: dict[tuple[str, str, float], Trial] = {}
        for stored in content["winners"]:
            trial = Trial(**_read({k: v for k, v in stored.items() if k != "tolerance"}))
            self.winners[trial.case, trial.peer, stored["tolerance"]] = trial
        tried = {(t.case, t.peer) for t in self.trials}
        self.impossible = {(c, p) for c in self.families for p in self.names if (c, p) not in tried}
        packages = ", ".join(f"{name} {found}" for name, found in content["versions"].items() if found)
        machine = content["machine"]
        self.machine = (
            f"{machine['processor']}, Python {machine['Python']}, {packages}, commit {machine['commit']}, "
            f"budget {content['budget']:g}"
        )
        self.hurry = (
            f" The searches had {content['budget']:g} of their time, so *not reached* often says no more than that."
            if content["budget"] < 1.0
            else ""
        )
        self.checks = _checks(content["cases"])

    def seconds(self, case: str, peer: str, tolerance: float) -> float:
        """Return the median time [s] of a peer's best setting; infinity where the tolerance was not reached."""
        winner = self.winners.get((case, peer, tolerance))
        return np.inf if winner is None else winner.seconds

    def ours(self, case: str, tolerance: float) -> float:
        """Return the faster of the project's two methods [s]."""
        return min(self.seconds(case, name, tolerance) for name in OURS)

    def cell(self, cases: list[str], peer: str, tolerance: float) -> str:
        """Return the median time over some cases with the median of the ratios to ours, or why there is none."""
        if all((case, peer) in self.impossible for case in cases):
            return "left out"
        times = [self.seconds(case, peer, tolerance) for case in cases]
        missing = int(np.sum(~np.isfinite(times)))
        if missing:
            return "not reached" if len(cases) == 1 else f"not reached ({missing} of {len(cases)})"
        ratios = [t / self.ours(case, tolerance) for case, t in zip(cases, times, strict=True)]
        return f"{1e3 * float(np.median(times)):.3g} ms ({float(np.median(ratios)):.2g}x)"

    def table(self, *, families: bool) -> str:
        """Return a Markdown table: a row a tolerance of every case, or of every family of cases."""
        rows = ["| case | mm | " + " | ".join(self.names) + " |", "|" + "---|" * (len(self.names) + 2)]
        groups: dict[str, list[str]] = {}
        for case, family in self.families.items():
            groups.setdefault(family if families else case, []).append(case)
        for name, cases in groups.items():
            for tolerance in TOLERANCES:
                cells = [self.cell(cases, peer, tolerance) for peer in self.names]
                rows.append(f"| {name} | {1e3 * tolerance:g} | " + " | ".join(cells) + " |")
        return "\n".join(rows)

    def wins(self) -> list[str]:
        """Return a line for every peer: where it is faster than ours, and how often ours misses its `ASKED` lead."""
        lines = []
        for peer in self.names:
            if peer.startswith("dlocore"):
                continue
            counts = [self._within(1.0, peer, tolerance) for tolerance in TOLERANCES]
            places = len(self.families) * len(TOLERANCES)
            where = ", ".join(f"{n} at {1e3 * tol:g} mm" for n, tol in zip(counts, TOLERANCES, strict=True) if n)
            count = f"{peer} is faster than dlocore in {sum(counts)} of {places}"
            asked = ASKED.get(peer, OFF_THE_SHELF)
            short = sum(self._within(asked, peer, tolerance) for tolerance in TOLERANCES)
            lines.append(f"{count}{': ' if where else ''}{where}; it is below {asked:g}x in {short}")
        return lines

    def _within(self, times: float, peer: str, tolerance: float) -> int:
        """Return in how many cases a peer takes less than so many times our time."""
        return sum(self.seconds(case, peer, tolerance) < times * self.ours(case, tolerance) for case in self.families)

    def curve(self, cases: list[str], peer: str) -> np.ndarray:
        """Return the median time [s] over some cases for the tolerances `FINE`; NaN where one is not reached."""
        times = np.full((len(cases), len(FINE)), np.nan)
        for i, case in enumerate(cases):
            mine = [t for t in self.trials if t.case == case and t.peer == peer]
            for j, tolerance in enumerate(FINE):
                found = best(mine, float(tolerance))
                times[i, j] = np.nan if found is None else found.seconds
        return np.median(times, axis=0)

    def setups(self) -> str:
        """Return the median set-up time of every peer's winners that has one."""
        parts = []
        for peer in self.names:
            times = [t.setup for (_, name, _), t in self.winners.items() if name == peer]
            if times and np.median(times) > SHORT:
                parts.append(f"{peer} {1e3 * float(np.median(times)):.2g} ms")
        return "Set-up apart, medians: " + ", ".join(parts) + "." if parts else "No peer has a set-up of its own."

    def text(self) -> str:
        """Return the tables and what they say, in Markdown, for the page of the documentation."""
        return "\n\n".join(
            [
                self.table(families=True),
                "\n".join(f"- {line}." for line in self.wins()),
                f"{self.setups()} {self.checks}{self.hurry} {self.machine}.",
            ]
        )

    def publish(self, page: Path, picture: Path) -> None:
        """Write the picture, and the tables between the marks of a page of the documentation."""
        before, rest = page.read_text().split(MARKS[0])
        after = rest.split(MARKS[1])[1]
        page.write_text(f"{before}{MARKS[0]}\n\n{self.text()}\n\n{MARKS[1]}{after}")
        self.plot(picture)

    def plot(self, file: Path) -> None:
        """Draw the work-precision diagram: one panel a kind of case, one curve a peer."""
        import matplotlib

        matplotlib.use("Agg")
        import matplotlib.pyplot as plt

        plane = [case for case, family in self.families.items() if family.startswith("plane")]
        panels: dict[str, list[str]] = {f"plane, median over {len(plane)}": plane} if plane else {}
        panels |= {case: [case] for case in self.families if case not in plane}
        figure, axes = plt.subplots(1, len(panels), figsize=(4.2 * len(panels), 5.0), sharey=True, squeeze=False)
        for axis, (title, cases) in zip(axes[0], panels.items(), strict=True):
            for peer in self.names:
                style: dict[str, Any] = {"color": COLOURS[peer], "label": peer, "linewidth": 1.8}
                style |= {"linestyle": "--"} if peer == "dlocore target_error" else {}
                axis.step(1e3 * FINE, 1e3 * self.curve(cases, peer), where="pre", **style)
            axis.set(title=title, xlabel="largest error over the motion [mm]", xscale="log", yscale="log")
            axis.set_xticks([10, 3, 1, 0.3, 0.1], labels=["10", "3", "1", "0.3", "0.1"])
            axis.set_xlim(20, 0.1)
            axis.grid(which="major", alpha=0.4)
            axis.grid(which="minor", axis="y", alpha=0.12)
        axes[0, 0].set_ylabel("processor time [ms]")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(
            handles, labels, ncols=4, fontsize=9, loc="lower center", bbox_to_anchor=(0.5, 0.04), frameon=False
        )
        figure.suptitle(self.headline(), fontsize=10)
        figure.text(0.5, 0.01, f"python -m benchmarks.peers; {self.machine}", ha="center", fontsize=7)
        figure.tight_layout(rect=(0, 0.13, 1, 1))
        file.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(file, dpi=110)
        plt.close(figure)

    def headline(self) -> str:
        """Return what the comparison found at 1 mm: each peer over ours, median of the cases that it reaches."""
        parts = []
        for peer in self.names:
            if peer.startswith("dlocore"):
                continue
            ratios = [self.seconds(case, peer, HEADLINE) / self.ours(case, HEADLINE) for case in self.families]
            known = [r for r in ratios if np.isfinite(r)]
            parts.append(f"{peer} {np.median(known):.2g} ({len(known)})" if known else f"{peer} never")
        reached = f"median of those of {len(self.families)} cases that it reaches (how many)"
        return f"Time for {1e3 * HEADLINE:g} mm over dlocore's, {reached}:\n" + ", ".join(parts)


def _checks(cases: list[dict[str, Any]]) -> str:
    """Return what the references are worth, and what it matters that some peers do not stretch."""
    moved, apart = (1e3 * max(case[name] for case in cases) for name in ("uncertainty", "check"))
    text = f"The last refinement moved the references by at most {moved:.2g} mm, "
    text += f"and a fine march is within {apart:.2g} mm of them."
    stretches: dict[str, float] = {}
    for case in cases:
        if case["stretch"] is not None:
            stretches[case["family"]] = max(case["stretch"], stretches.get(case["family"], 0.0))
    if stretches:
        listed = ", ".join(f"{1e3 * most:.2g} mm ({family})" for family, most in stretches.items())
        text += f" A cable that does not stretch moves otherwise by up to {listed}."
    return text


def _read(stored: dict[str, Any]) -> dict[str, Any]:
    """Return a stored trial with infinity where an error is missing: JSON has none."""
    return {k: np.inf if v is None else v for k, v in stored.items()}
