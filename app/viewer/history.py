"""The scenes that one tab had before and, after a step back, those it had after."""

from app.viewer.draft import Draft

JOINED = 1.0  # s: changes that follow each other sooner are one step, as a drag or a slider makes twenty a second
MOST = 200  # steps back


class History:
    """Steps back and forward among the drafts of one tab."""

    def __init__(self) -> None:
        self._past: list[Draft] = []
        self._future: list[Draft] = []
        self._changed_at = -float("inf")

    @property
    def steps(self) -> tuple[bool, bool]:
        """Whether there is a step back, and one forward."""
        return bool(self._past), bool(self._future)

    def copy(self) -> "History":
        """Return the same steps, to be gone by another."""
        other = History()
        other._past, other._future = [*self._past], [*self._future]
        return other

    def changed(self, before: Draft, now: float) -> None:
        """Keep what a draft was before a change at the time `now` [s], unless it goes on with the change before."""
        if not self._past or now - self._changed_at >= JOINED:
            self._past = [*self._past, before][-MOST:]
        self._future = []
        self._changed_at = now

    def close_step(self) -> None:
        """Let the next change be a step of its own, however soon it comes."""
        self._changed_at = -float("inf")

    def back(self, present: Draft) -> Draft:
        """Return the draft a step before the present one; that one where there is none."""
        return self._step(self._past, self._future, present)

    def forward(self, present: Draft) -> Draft:
        """Return the draft a step after the present one; that one where there is none."""
        return self._step(self._future, self._past, present)

    def _step(self, here: list[Draft], there: list[Draft], present: Draft) -> Draft:
        if not here:
            return present
        self.close_step()
        there.append(present)
        return here.pop()
