"""Compare a study with an earlier one: what became slower or less accurate, beyond noise."""

from dataclasses import dataclass

from dlocore.study.record import Run, Study
from dlocore.words import counted

SLOWER = 1.15  # times: two measurements on one machine may differ by this without any change
SPREADS = 4.0  # times the spreads of both: about 2.7 standard deviations of a normal distribution
LEAST_REPEATS = 3  # of both: with fewer, the spread says nothing about the noise
LESS_ACCURATE = 1.1  # times: the compiler may reorder additions, and Newton's iterations may stop elsewhere


@dataclass(frozen=True, kw_only=True)
class Change:
    """One quantity of one run that changed.

    Attributes:
        run: the run, in words.
        quantity: "time" [s], "error" [m] or "status".
        before: its value in the earlier study.
        now: its value.
        worse: whether it became worse.
    """

    run: str
    quantity: str
    before: float | str
    now: float | str
    worse: bool


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """What changed between two studies.

    Attributes:
        changes: those beyond noise, the worse ones first.
        compared: number of runs that both have.
        missing: runs that only the earlier one has, in words.
        same_machine: whether times could be compared.
        barely_timed: runs whose times were not compared because one of the studies has fewer than three of them.
        same_judge: whether errors could be compared.
    """

    changes: tuple[Change, ...]
    compared: int
    missing: tuple[str, ...]
    same_machine: bool
    barely_timed: int
    same_judge: bool

    @property
    def worse(self) -> tuple[Change, ...]:
        """The changes for the worse."""
        return tuple(change for change in self.changes if change.worse)


def compare(now: Study, before: Study) -> Comparison:
    """Compare the runs that two studies have in common.

    A time has changed if it differs by more than 15 % and by more than four times the spreads of both. An error has
    changed if it differs by more than 10 % and by more than the errors of both truths. Times of different machines or
    of fewer than three repeats, and errors against different truths, are not compared.
    """
    earlier = {run.key: run for run in before.runs}
    pairs = [(run, earlier[run.key]) for run in now.runs if run.key in earlier]
    machines = all(now.machine.get(part) == before.machine.get(part) for part in ("processor", "cores", "system"))
    judges = now.judge == before.judge
    timed = [run.key for run, old in pairs if min(run.repeats, old.repeats) >= LEAST_REPEATS]
    changes = []
    for run, old in pairs:
        changes += _status(run, old)
        if machines and run.key in timed:
            changes += _time(run, old)
        if judges and run.status == old.status:
            changes += _error(run, old)
    changes.sort(key=lambda change: not change.worse)
    measured = {run.key for run in now.runs}
    return Comparison(
        changes=tuple(changes),
        compared=len(pairs),
        missing=tuple(_name(run) for run in before.runs if run.key not in measured),
        same_machine=machines,
        barely_timed=len(pairs) - len(timed),
        same_judge=judges,
    )


def _status(run: Run, old: Run) -> list[Change]:
    if run.status == old.status:
        return []
    worse = old.status == "converged"
    return [Change(run=_name(run), quantity="status", before=old.status, now=run.status, worse=worse)]


def _time(run: Run, old: Run) -> list[Change]:
    slower = run.wall_time > old.wall_time
    ratio = max(run.wall_time, old.wall_time) / min(run.wall_time, old.wall_time)
    noise = SPREADS * (run.spread + old.spread)
    if ratio <= SLOWER or abs(run.wall_time - old.wall_time) <= noise:
        return []
    return [Change(run=_name(run), quantity="time", before=old.wall_time, now=run.wall_time, worse=slower)]


def _error(run: Run, old: Run) -> list[Change]:
    if run.truth_error is None or old.truth_error is None:
        return []
    most, least = max(run.error, old.error), min(run.error, old.error)
    if most <= LESS_ACCURATE * least or most - least <= run.truth_error + old.truth_error:
        return []
    return [Change(run=_name(run), quantity="error", before=old.error, now=run.error, worse=run.error > old.error)]


def _name(run: Run) -> str:
    effects = "" if run.effects == "auto" else f", effects {run.effects}"
    return f"{run.scene}{effects}: {run.method}, {run.n_u} x {run.n_t}, delta {run.delta:g}"


def words(comparison: Comparison) -> str:
    """Return a comparison as text."""
    compared, worse = counted(comparison.compared, "run"), counted(len(comparison.worse), "change")
    lines = [f"{compared} compared; {worse} for the worse"]
    lines += [f"not measured now: {run}" for run in comparison.missing]
    if not comparison.same_machine:
        lines.append("different machines: times are not compared")
    elif comparison.barely_timed:
        of = counted(comparison.barely_timed, "run")
        lines.append(f"times of {of} are not compared: fewer than {LEAST_REPEATS} repeats in one of the studies")
    if not comparison.same_judge:
        lines.append("different judges: errors are not compared")
    for change in comparison.changes:
        mark = "worse " if change.worse else "better"
        lines.append(f"{mark} {_shown(change):34} {change.run}")
    return "\n".join(lines)


def _shown(change: Change) -> str:
    if isinstance(change.before, str) or isinstance(change.now, str):
        return f"{change.quantity} {change.before} -> {change.now}"
    unit = "ms" if change.quantity == "time" else "mm"
    ratio = change.now / change.before if change.before > 0 else float("inf")
    return f"{change.quantity} {1e3 * change.before:.3g} -> {1e3 * change.now:.3g} {unit} ({ratio:.2f} x)"
