"""Messages of the solver, translated from the terms of the API to those of the panel."""

import html

import pytest
from protocol_client import connected

from app.schemas import PredictionRequest
from app.viewer import report
from app.viewer.wording import LABELS, in_labels, problem_in_labels
from dlocore.errors import MILLIMETRES

PLACES = [0.25, 1.0]


@pytest.mark.parametrize(
    ("said", "told"),
    [
        (
            "primitives[1].path: got 1.2 m from primitives[0] at 1.6 s",
            "path of gripper 2 at 1 m: got 1.2 m from gripper 1 at 0.25 m at 1.6 s",
        ),
        ("primitives[0].path.displacement[1]: got nan", "Target of gripper 1 at 0.25 m: got nan"),
        ("primitives[0].path.times[4] is 0.1 s after", "path.times[4] of gripper 1 at 0.25 m is 0.1 s after"),
        ("the path of primitives[7] swings", "the path of gripper 8 swings"),
        ("environment.obstacles[2].radius: got 0.0", "Radius of obstacle 3: got 0.0"),
        (
            "It takes the cable 0.0125 m into obstacles[0] at 1.16 s",
            "It takes the cable 0.0125 m into obstacle 1 at 1.16 s",
        ),
        ("obstacles[1] begins 2 mm above the table", "obstacle 2 begins 2 mm above the table"),
        ("loads[0].force.times: got [0.499, 0.5, 0.299, 0.3]", "Until of force 1: got [0.499, 0.5, 0.299, 0.3]"),
        ("loads[1].u: got 2.0", "Acts at u of force 2: got 2.0"),
        ("environment.table.height: got inf", "Table height: got inf"),
        ("cable.point_masses[0].u: got 2.0", "Placed at u: got 2.0"),
        ("horizon: got None", "Predict until: got None"),
        ("it closes at 3 s and the horizon is 2 s", "it closes at 3 s and the horizon is 2 s"),
        ("environment.drag_quadratic: got -1.0", "Drag [N s²/m³]: got -1.0"),
        ("give axial_stiffness", "give EA"),
        ("effects.self_contact on keeps them apart", "the effect self contact on keeps them apart"),
        ("ask for a smaller target_error.", "ask for a smaller target error on the tab Quality."),
        ("quality.target_error: got 0.0", "Target error: got 0.0"),
        ("cable.youngs_modulus: got 0.0", "cable.youngs_modulus: got 0.0"),
        ("a given grid with larger n_u and n_t shows waves", "a given grid with larger n_u and n_t shows waves"),
    ],
)
def test_fields_of_the_api_are_called_as_on_the_panel(said, told):
    assert in_labels(said, PLACES) == told


def test_what_is_wrong_begins_as_a_sentence_does():
    problem, details = problem_in_labels("primitives[0] holds it", "primitives[1].path: got 2 m, allowed: 1 m.", PLACES)
    assert problem == "Gripper 1 at 0.25 m holds it"
    assert details == "Path of gripper 2 at 1 m: got 2 m, allowed: 1 m."
    assert problem_in_labels("why", "cable.hardening: got 2.", []) == ("why", "cable.hardening: got 2.")


def test_a_target_error_is_typed_in_millimetres_and_not_taken_for_them():
    details = "quality.target_error: got 10.0, allowed: at most the cable's length, 1 [m]."
    problem, told = problem_in_labels(MILLIMETRES, details, PLACES)
    assert problem == "Target error"
    card = report.problem_card(MILLIMETRES, details, PLACES)
    assert MILLIMETRES not in card
    assert html.escape(told) in card


def test_every_label_is_one_of_the_panel(service):
    with connected(service) as client:
        shown = {control.get("label") for control in client.controls.values()}
        assert set(LABELS.values()) <= shown


@pytest.mark.parametrize("field", LABELS)
def test_every_field_is_one_of_the_api(field):
    schema = PredictionRequest.model_json_schema()

    def has(node, names):
        """Return whether a node of the schema leads to a field."""
        if not names:
            return True
        if "$ref" in node:
            return has(schema["$defs"][node["$ref"].rsplit("/", 1)[1]], names)
        forms = [*node.get("anyOf", []), *node.get("oneOf", [])]
        inner = node.get("items") if names[0] == "[]" else node.get("properties", {}).get(names[0])
        return (inner is not None and has(inner, names[1:])) or any(has(form, names) for form in forms)

    assert has(schema, field.replace("[]", ".[]").split("."))
