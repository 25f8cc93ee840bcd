"""The clock of the animation."""

from dataclasses import dataclass

REST_AT_END = 0.7  # s, pause before the motion starts again


@dataclass
class Playback:
    """Where the animation stands.

    Attributes:
        horizon: predicted time [s].
        time: shown time [s].
        speed: predicted seconds per second of real time.
        playing: whether the animation is playing.
        looping: whether it starts again after the end.
    """

    horizon: float = 1.0
    time: float = 0.0
    speed: float = 1.0
    playing: bool = True
    looping: bool = True
    _rested: float = 0.0
    _held: tuple[bool, float] | None = None  # whether it was playing, and its time, before it was held

    def play(self) -> None:
        """Play; from the start if the end is shown."""
        if self.time >= self.horizon:
            self.time = 0.0
        self.playing = True
        self._rested = 0.0
        self._held = None

    def pause(self) -> None:
        """Pause."""
        self.playing = False
        self._held = None

    def hold(self, time: float) -> None:
        """Hold the animation at `time` [s] while the user drags something."""
        held = (self.playing, self.time)
        self.pause()
        self.seek(time)
        self._held = held

    def resume(self) -> None:
        """Restore the state before `hold`, unless the animation was played or paused since then."""
        if self._held is not None:
            ran, time = self._held
            self._held = None
            if ran:
                self.play()
            else:
                self.seek(time)

    def seek(self, time: float) -> None:
        """Show `time` [s]."""
        self.time = min(max(time, 0.0), self.horizon)
        self._rested = 0.0

    def set_horizon(self, horizon: float) -> None:
        """Take over the horizon [s] of a new prediction."""
        self.horizon = horizon
        self.time = min(self.time, horizon)

    def advance(self, elapsed: float) -> bool:
        """Advance by `elapsed` [s] of real time; return whether picture and panel have to be updated."""
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
