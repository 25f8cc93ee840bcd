"""The clock of the animation."""

from dataclasses import dataclass

REST_AT_END = 0.7  # s, before the motion starts again


@dataclass
class Playback:
    """Where the animation stands.

    Attributes:
        horizon: predicted time [s].
        time: shown time [s].
        speed: predicted seconds per second.
        playing: whether the time runs.
        looping: whether it starts again after the end.
    """

    horizon: float = 1.0
    time: float = 0.0
    speed: float = 1.0
    playing: bool = True
    looping: bool = True
    _rested: float = 0.0

    def play(self) -> None:
        """Run, from the start where the end is shown."""
        if self.time >= self.horizon:
            self.time = 0.0
        self.playing = True
        self._rested = 0.0

    def pause(self) -> None:
        """Stand still."""
        self.playing = False

    def seek(self, time: float) -> None:
        """Show `time` [s]."""
        self.time = min(max(time, 0.0), self.horizon)
        self._rested = 0.0

    def set_horizon(self, horizon: float) -> None:
        """Take over the horizon [s] of a new prediction."""
        self.horizon = horizon
        self.time = min(self.time, horizon)

    def advance(self, elapsed: float) -> bool:
        """Let `elapsed` [s] of real time pass; say whether the shown time changed."""
        if not self.playing:
            return False
        if self.time < self.horizon:
            self.time = min(self.time + self.speed * elapsed, self.horizon)
            return True
        self._rested += elapsed
        if self._rested < REST_AT_END:
            return False
        self._rested = 0.0
        if self.looping:
            self.time = 0.0
        else:
            self.playing = False
        return True
