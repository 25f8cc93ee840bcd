"""How far a cable may be strained along itself, and what is told of one that is strained by more."""

from dlocore.scene.cable import Cable

TORN = 0.2  # axial strain: no cable of this kind follows
STRAINED = 0.05  # axial strain: few cables bear more
FOLDED = 0.4  # of |r'| within a span: less is a fold that no energy sees
RUBBER = 0.01  # axial strain: few cables bear more without harm, of one whose axial stiffness is assumed


def strain_notes(cable: Cable, strain: float, what: str) -> list[str]:
    """Return what is told of what strains a cable by more than few bear, by less where EA is assumed, in words."""
    solid = cable.axial_stiffness == cable.solid_axial_stiffness  # assumed, or given like that
    if not strain > (RUBBER if solid else STRAINED):
        return []
    soft = f", with the {cable.axial_stiffness:.3g} N of a solid section of its bending stiffness: give axial_stiffness"
    return [f"{what} strains the cable by up to {strain:.0%} along itself{soft if solid else ''}"]
