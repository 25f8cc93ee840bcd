"""Limits of the axial strain of a cable, and the notes on cables that exceed them."""

from dlocore.scene.cable import Cable

TORN = 0.2  # axial strain that no cable of this kind follows
STRAINED = 0.05  # axial strain that few cables bear
FOLDED = 0.4  # smallest |r'| within a span: less is a fold that no energy sees
RUBBER = 0.01  # as STRAINED, for a cable whose axial stiffness is assumed


def strain_notes(cable: Cable, strain: float, what: str) -> list[str]:
    """Return a note if `what` strains a cable by more than STRAINED, or by more than RUBBER if EA is assumed."""
    solid = cable.axial_stiffness == cable.solid_axial_stiffness  # assumed, or given like that
    if not strain > (RUBBER if solid else STRAINED):
        return []
    stiffness = f", with the {cable.axial_stiffness:.3g} N of a solid section of the same EI"
    soft = f"{stiffness}: give axial_stiffness if it differs" if solid else ""
    return [f"{what} strains the cable by up to {strain:.0%} along itself{soft}"]
