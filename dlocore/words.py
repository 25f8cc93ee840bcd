"""Numbers as messages write them."""


def in_mm(length: float, digits: int = 2) -> str:
    """Return a length [m] as millimetres to so many digits, or to whole ones: 580 mm, not 5.8e+02 mm."""
    mm = 1e3 * length
    short = f"{mm:.{digits}g}"
    return f"{mm:.0f} mm" if "e+" in short else f"{short} mm"
