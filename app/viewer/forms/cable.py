"""The form of the cable: its preset, its values, and what it remembers."""

from typing import Any

from viser import GuiApi

from app.store.cables import KeptCables
from app.viewer.draft import Draft
from app.viewer.edits import Edits
from app.viewer.forms.base import Form, show_choice, show_if, show_value
from app.viewer.number_field import NumberField
from app.viewer.rounding import rounded
from app.viewer.shapes import scaled
from dlocore import PRESETS, Cable, SceneError
from dlocore.scene.cable import MAX_LENGTH, MIN_LENGTH, STIFFNESSES

CUSTOM = "own values"
RESTS, LOADED = ("straight", "initial"), "as loaded"
PLASTIC_RATE = 50.0  # 1/s, memory rate if a yield strain is set but no rate


class CableForm(Form):
    """Edits the cable."""

    def __init__(self, gui: GuiApi, draft: Draft, edits: Edits, cables: KeptCables) -> None:
        super().__init__(draft, edits)
        self._cables = cables
        self._kept = cables.all()
        with gui.add_folder("Cable"):
            self._preset = gui.add_dropdown("Preset", (*PRESETS, *self._kept))
            self._length = NumberField(gui, "Length [m]", 1.0, low=MIN_LENGTH, high=MAX_LENGTH)
            self._diameter = NumberField(gui, "Diameter [mm]", 1.0, low=0.01, high=5e5)
            self._density = NumberField(gui, "Density [g/m]", 1.0, low=0.01, high=1e7)
            self._bending = NumberField(gui, "EI [10⁻³ N m²]", 1.0, low=1e-6, high=1e9)
            self._connector = NumberField(
                gui, "Connector [g]", 0.0, low=0.0, high=1e7, hint="A point mass on the cable; 0: none"
            )
            self._connector_u = NumberField(gui, "Placed at u [m]", 1.0, low=0.0, high=MAX_LENGTH)
            with gui.add_folder("More of the cable", expand_by_default=False):
                self._torsion = NumberField(gui, "GJ [10⁻³ N m²]", 1.0, low=1e-6, high=1e9)
                self._stretch = NumberField(gui, "EA [N]", 1.0, low=1e-3, high=1e12)
                self._damping = NumberField(gui, "Damping [10⁻³ N m² s]", 0.0, low=0.0, high=1e9, hint="In bending")
                self._torsion_damping = NumberField(gui, "Twist damping [10⁻³ N m² s]", 0.0, low=0.0, high=1e9)
                self._stretch_damping = NumberField(
                    gui, "Stretch damping [N s]", 0.0, low=0.0, high=1e9, hint="0: waves of stretch do not die out"
                )
                self._yield = NumberField(
                    gui, "Yields at strain [%]", 0.0, low=0.0, high=1000.0, hint="In its outermost fibre; 0: never"
                )
                self._rate = NumberField(gui, "Memory rate [1/s]", PLASTIC_RATE, low=1e-3, high=1e9)
                self._rest = gui.add_dropdown("Stress-free shape", RESTS, hint="initial: the start shape")
        self._bind(self._preset, self._with_preset)
        self._bind(self._length, lambda d: scaled(d, self._length.value))
        self._bind(self._diameter, lambda d: self._with(d, "diameter", 1e-3 * self._diameter.value))
        self._bind(self._density, lambda d: self._with(d, "linear_density", 1e-3 * self._density.value))
        self._bind(self._connector, self._with_connector)
        self._bind(self._connector_u, self._with_place)
        self._bind(self._bending, lambda d: self._with(d, "bending_stiffness", 1e-3 * self._bending.value))
        self._bind(self._torsion, lambda d: self._with(d, "torsional_stiffness", 1e-3 * self._torsion.value))
        self._bind(self._stretch, lambda d: self._with(d, "axial_stiffness", self._stretch.value))
        self._bind(self._damping, lambda d: self._with(d, "bending_damping", 1e-3 * self._damping.value))
        self._bind(
            self._torsion_damping, lambda d: self._with(d, "torsional_damping", 1e-3 * self._torsion_damping.value)
        )
        self._bind(self._stretch_damping, lambda d: self._with(d, "axial_damping", self._stretch_damping.value))
        self._bind(self._yield, lambda d: self._with_yield(d, 1e-2 * self._yield.value))
        self._bind(self._rate, lambda d: self._with(d, "memory_rate", self._rate.value))
        self._bind(self._rest, lambda d: d.put(("cable", "rest_shape"), self._rest.value))

    @staticmethod
    def _with(draft: Draft, name: str, value: float) -> Draft:
        draft = draft.put(("cable", name), rounded(value))
        for modulus, stiffnesses in STIFFNESSES.items():
            if all(draft.get(("cable", stiffness)) is not None for stiffness in stiffnesses):
                draft = draft.put(("cable", modulus), None)  # refused beside all that it gives
        return draft

    def _with_preset(self, draft: Draft) -> Draft:
        name = self._preset.value
        if name in self._kept:
            kept = self._kept[name]
            for key, value in kept["environment"].items():
                draft = draft.put(("environment", key), value)
            return draft.put(("cable",), {**kept["cable"], **self._as_it_is(draft)})
        return draft.put(("cable",), {**PRESETS[name].values, **self._as_it_is(draft)})

    @staticmethod
    def _as_it_is(draft: Draft) -> dict[str, Any]:
        """Return what a cable keeps when its preset changes: its length and its point masses."""
        masses = draft.get(("cable", "point_masses"))
        return {"length": draft.length, **({"point_masses": masses} if masses else {})}

    def _with_connector(self, draft: Draft) -> Draft:
        """Set the mass of the first point mass; a new one goes to the far end, and 0 removes it. Others stay."""
        masses = draft.get(("cable", "point_masses"), [])
        mass = rounded(1e-3 * self._connector.value)
        first = [{"u": masses[0]["u"] if masses else draft.length, "mass": mass}] if mass > 0.0 else []
        return draft.put(("cable", "point_masses"), [*first, *masses[1:]])

    def _with_place(self, draft: Draft) -> Draft:
        """Move the first point mass, if there is one."""
        u = rounded(min(self._connector_u.value, draft.length))
        there = draft.get(("cable", "point_masses"))
        return draft.put(("cable", "point_masses", 0, "u"), u) if there else draft

    def offer(self) -> None:
        """Offer the cables that are kept now among the presets."""
        self._kept = self._cables.all()
        self._take_preset(self._draft)

    def _with_yield(self, draft: Draft, strain: float) -> Draft:
        if strain <= 0.0:
            return draft.put(("cable", "yield_strain"), None).put(("cable", "memory_rate"), None)
        rate = draft.get(("cable", "memory_rate"), PLASTIC_RATE)
        return self._with(draft, "yield_strain", strain).put(("cable", "memory_rate"), rate)

    def take(self, draft: Draft) -> None:
        """Show `draft` and the preset that it matches, if any; if it makes no cable, the controls stay as they are."""
        self._draft = draft
        try:
            cable = draft.cable()
        except SceneError:
            return
        self._take_preset(draft)
        show_value(self._length, cable.length)
        show_value(self._diameter, _shown(1e3, cable.diameter))
        show_value(self._density, _shown(1e3, cable.linear_density))
        show_value(self._bending, _shown(1e3, cable.bending_stiffness))
        show_value(self._torsion, _shown(1e3, cable.torsional_stiffness))
        show_value(self._stretch, _shown(1.0, cable.axial_stiffness))
        show_value(self._damping, _shown(1e3, cable.bending_damping))
        show_value(self._torsion_damping, _shown(1e3, cable.torsional_damping))
        show_value(self._stretch_damping, _shown(1.0, cable.axial_damping))
        show_value(self._yield, _shown(1e2, cable.yield_strain or 0.0))
        first = cable.point_masses[0] if cable.point_masses else None
        show_value(self._connector, _shown(1e3, first.mass if first else 0.0))
        show_if(self._connector_u, first is not None)
        if first is not None:
            self._connector_u.high = cable.length
            show_value(self._connector_u, _shown(1.0, first.u))
        show_value(self._rate, cable.memory_rate or PLASTIC_RATE)
        show_if(self._rate, cable.memory_rate is not None)
        self._take_rest(cable)

    def _take_preset(self, draft: Draft) -> None:
        presets, found = (*PRESETS, *self._kept), preset_of(draft.get(("cable",), {}), self._kept)
        show_choice(self._preset, presets if found in presets else (*presets, CUSTOM), found)

    def _take_rest(self, cable: Cable) -> None:
        rest = cable.rest_shape if isinstance(cable.rest_shape, str) else LOADED
        show_choice(self._rest, RESTS if rest in RESTS else (*RESTS, LOADED), rest)


def _shown(scale: float, value: float | None) -> float:
    return rounded(scale * (value or 0.0), 7)


def preset_of(cable: dict[str, Any], kept: dict[str, dict[str, Any]] | None = None) -> str:
    """Return the name of the preset or kept cable that has the values of `cable`, or `CUSTOM`.

    Length and point masses are not compared.
    """
    values = {name: value for name, value in cable.items() if name not in ("length", "point_masses")}
    if set(values) == {"preset"}:
        return str(values["preset"])
    for name, preset in PRESETS.items():
        if values == {key: value for key, value in preset.values.items() if key != "length"}:
            return name
    return next((name for name, one in (kept or {}).items() if values == one["cable"]), CUSTOM)
