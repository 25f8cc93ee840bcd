"""The JSON contract: requests, answers, and their conversion to and from the solver's data."""

from app.schemas.convert import Motion, to_scene
from app.schemas.describe import from_scene
from app.schemas.request import EXAMPLES, PredictionRequest
from app.schemas.response import PredictionList, PredictionResponse, from_prediction, problem_document

__all__ = [
    "EXAMPLES",
    "Motion",
    "PredictionList",
    "PredictionRequest",
    "PredictionResponse",
    "from_prediction",
    "from_scene",
    "problem_document",
    "to_scene",
]
