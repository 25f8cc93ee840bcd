"""The controls that edit a draft, in the units people use: mm, g/m, 10⁻³ N m², degrees."""

from app.viewer.forms.base import show_if, show_value
from app.viewer.forms.cable import CableForm
from app.viewer.forms.effects import EffectsForm
from app.viewer.forms.gripper import GripperForm
from app.viewer.forms.loads import LoadsForm
from app.viewer.forms.quality import QualityForm
from app.viewer.forms.surroundings import SurroundingsForm

__all__ = [
    "CableForm",
    "EffectsForm",
    "GripperForm",
    "LoadsForm",
    "QualityForm",
    "SurroundingsForm",
    "show_if",
    "show_value",
]
