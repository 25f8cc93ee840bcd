"""The history of one tab's scenes, for undo and redo."""

from app.viewer.draft import Draft

JOINED = 1.0  # s: changes that follow each other sooner are one step; a drag or a slider makes twenty a second
MOST = 200  # most steps back


class History:
    """Steps back and forward among the drafts of one tab."""

    def __init__(self) -> None:
        self._past: list[Draft] = []
        self._future: list[Draft] = []
        self._changed_at = -float("inf")

    @property
    def steps(self) -> tuple[bool, bool]:
        """Whether there is a step back, and whether there is one forward."""
        return bool(self._past), bool(self._future)

    def copy(self) -> "History":
        """Return an independent copy."""
        other = History()
        other._past, other._future = [*self._past], [*self._future]
        return other

    def changed(self, before: Draft, now: float) -> None:
        """Keep the draft before a change at the time `now` [s], unless the change belongs to the last step."""
        if not self._past or now - self._changed_at >= JOINED:
            self._past = [*self._past, before][-MOST:]
        self._future = []
        self._changed_at = now

    def close_step(self) -> None:
        """Make the next change a new step, however soon it comes."""
        self._changed_at = -float("inf")

    def back(self, present: Draft) -> Draft:
        """Return the draft one step before the present one, or the present one if there is none."""
        return self._step(self._past, self._future, present)

    def forward(self, present: Draft) -> Draft:
        """Return the draft one step after the present one, or the present one if there is none."""
        return self._step(self._future, self._past, present)

    def _step(self, here: list[Draft], there: list[Draft], present: Draft) -> Draft:
        if not here:
            return present
        self.close_step()
        there.append(present)
        return here.pop()
