"""Numbers in the form that messages use."""


def in_mm(length: float, digits: int = 2) -> str:
    """Return a length [m] in millimetres, with `digits` significant digits, or whole if large: 580 mm, not 5.8e+02."""
    return f"{_short(1e3 * length, digits)} mm"


def in_um(length: float, digits: int = 2) -> str:
    """Return a length [m] in micrometres, with `digits` significant digits, or whole if large: 1000 um, not 1e+03."""
    return f"{_short(1e6 * length, digits)} um"


def in_ms(time: float, digits: int = 3) -> str:
    """Return a time [s] in milliseconds, with `digits` significant digits, or whole if large: 2000 ms, not 2e+03."""
    return f"{_short(1e3 * time, digits)} ms"


def in_newtons(force: float, digits: int = 2) -> str:
    """Return a force [N] with `digits` significant digits, or whole if large: 264 N, not 2.6e+02 N."""
    return f"{_short(force, digits)} N"


def in_m_per_s2(acceleration: float, digits: int = 2) -> str:
    """Return an acceleration [m/s^2] with `digits` significant digits, or whole if large: 180 m/s^2."""
    return f"{_short(acceleration, digits)} m/s^2"


def per_m(curvature: float, digits: int = 2) -> str:
    """Return a curvature [1/m] with `digits` significant digits, or whole if large: 264 /m."""
    return f"{_short(curvature, digits)} /m"


def counted(count: int, what: str) -> str:
    """Return a count with its noun, given in the singular: 1 iteration, 2 iterations."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _short(value: float, digits: int) -> str:
    short = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e+" in short else short
