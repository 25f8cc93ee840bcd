"""Edits of a draft, without a service: clicks, rotations, new grippers and numbers on the panel."""

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from protocol_client import NOTHING_STORED
from scipy.spatial.transform import Rotation

from app.schemas.request import EXAMPLES
from app.viewer import grips, obstacle_edits, plots, report
from app.viewer.draft import Draft, start_draft
from app.viewer.forms.cable import CUSTOM, CableForm, preset_of
from app.viewer.palette import ramp
from app.viewer.picking import NEAR_CABLE, CableClick, GripperClick, picked
from dlocore import PRESETS, EffectReport, SceneError, predict
from dlocore.calibration import Measured

CABLE = np.column_stack([np.linspace(0, 1, 121), np.zeros(121), np.zeros(121)])
BODY = np.column_stack([np.full(5, 0.25), np.zeros(5), np.linspace(0.03, 0.12, 5)])
EYE = np.array([0.3, -1.0, 1.0])


def looked_at(point, bodies=()):
    return picked(EYE, np.asarray(point) - EYE, CABLE, 1.0, list(bodies))


def test_a_click_on_the_cable_tells_its_place():
    assert looked_at((0.7, 0.0, 0.0)) == CableClick(pytest.approx(0.7, abs=1 / 240))  # half a step of the points


def test_a_click_beside_the_cable_means_nothing():
    far = 1.2 * NEAR_CABLE * np.linalg.norm(EYE - (0.3, 0.0, 0.0)) * np.array([0.0, 1.0, 1.0]) / np.sqrt(2)
    assert looked_at(np.array([0.3, 0.0, 0.0]) + far) is None


def test_a_click_on_a_gripper_is_not_one_on_the_cable_behind_it():
    assert looked_at(BODY[2], [BODY + np.array([0.5, 0.0, 0.0]), BODY]) == GripperClick(1)


def test_an_open_gripper_is_not_clicked():
    assert looked_at(CABLE[30], [np.zeros((0, 3))]) == CableClick(0.25)


def test_a_turn_that_goes_on_passes_half_and_full_turns_without_a_jump():
    axis = np.array([0.0, 0.6, 0.8])
    turn = np.zeros(3)
    for angle in np.arange(0.0, 15.0, 0.5):
        wxyz = np.roll(Rotation.from_rotvec(angle * axis).as_quat(), 1)
        turn = grips.nearest_turn(wxyz, turn)
        np.testing.assert_allclose(turn, angle * axis, rtol=0, atol=1e-12)  # rounding


def test_a_target_is_where_it_was_put():
    draft = start_draft()
    begin = draft.start(NOTHING_STORED)(0.25)[0]
    moved = grips.with_target(draft, begin, np.array([0.1, -0.2, 0.3]))
    np.testing.assert_allclose(grips.target(moved, begin), (0.1, -0.2, 0.3), rtol=0, atol=1e-6)  # kept to 1 µm


def test_the_last_waypoint_is_the_target_of_a_gripper_that_follows_some():
    path = {"kind": "waypoints", "times": [0, 1], "positions": [[0.25, 0, 0], [0.25, 0.3, 0]]}
    draft = Draft.of(start_draft().put(("primitives", 0, "path"), path).document)
    moved = grips.with_target(draft, np.zeros(3), np.array([0.3, 0.2, 0.0]))
    assert moved.primitives[0]["path"]["positions"] == [[0.25, 0, 0], [0.3, 0.2, 0.0]]
    assert draft.primitives[0]["path"]["positions"][1] == [0.25, 0.3, 0]  # the earlier draft is unchanged


def test_a_second_gripper_leaves_a_scene_that_the_cable_can_follow():
    draft = start_draft()
    scene = grips.added(draft, draft.start(NOTHING_STORED)).scene(NOTHING_STORED)
    ends = [np.array([g.u, 0.0, 0.0]) + g.path.at(np.array([9.0]), np.zeros(3))[0] for g in scene.grasps]
    assert [g.u for g in scene.grasps] == [0.25, 1.0]
    assert np.linalg.norm(ends[1] - ends[0]) < 0.75  # m of cable between them


def test_a_point_that_is_held_without_its_direction_does_not_turn():
    draft = grips.with_turn(grips.with_hold(start_draft(), "tangent"), np.array([0.0, 0.0, 0.5]))
    assert "rotation" in draft.primitives[0]["path"]
    again = grips.with_hold(draft, "point")
    assert "rotation" not in again.primitives[0]["path"]
    again.scene(NOTHING_STORED)


def test_new_obstacles_stand_beside_each_other():
    draft = start_draft()
    kinds = ("cylinder", "cylinder", "box", "capsule", "sphere", "box")
    for kind in kinds:
        draft = obstacle_edits.added(draft, kind)
    bodies = obstacle_edits.obstacles(draft)
    middles = np.array([obstacle_edits.centre(body) for body in bodies])
    # half the largest extent of each kind across the table [m]: round ones lie along x or stand
    half = np.array([{"cylinder": 0.03, "box": 0.03, "capsule": 0.025, "sphere": 0.04}[kind] for kind in kinds])
    order = np.argsort(middles[:, 1])
    gaps = np.diff(middles[order, 1]) - half[order][1:] - half[order][:-1]
    assert gaps.min() > 0.0
    assert gaps.max() < 0.25
    assert middles[0] == pytest.approx([0.55, 0.2, 0.05])
    draft.scene(NOTHING_STORED)


@pytest.mark.parametrize("kind", ["capsule", "cylinder"])
def test_a_round_obstacle_keeps_its_direction_when_its_length_passes_through_nothing(kind):
    draft = obstacle_edits.added(start_draft(), kind)
    for wanted in (0.0, -0.1, 0.3):
        draft = obstacle_edits.lengthened(draft, 0, wanted)
    (body,) = obstacle_edits.obstacles(draft)
    assert obstacle_edits.length(body) == pytest.approx(0.3, rel=1e-12)
    draft.scene(NOTHING_STORED)


def test_a_number_that_is_not_allowed_is_named_with_what_is():
    draft = start_draft().put(("cable", "diameter"), -1.0)
    with pytest.raises(SceneError) as refused:
        draft.scene(NOTHING_STORED)
    assert refused.value.field == "cable.diameter"
    assert refused.value.allowed


def test_a_stiffness_that_is_set_takes_the_place_of_its_modulus():
    cable = {"length": 1.0, "diameter": 0.006, "linear_density": 0.05, "youngs_modulus": 2e7, "shear_modulus": 7e6}
    draft = CableForm._with(start_draft().put(("cable",), cable), "bending_stiffness", 1e-3)
    assert draft.get(("cable", "youngs_modulus")) == 2e7  # it gives EA
    for name in ("axial_stiffness", "torsional_stiffness"):
        draft = CableForm._with(draft, name, 2.0)
    assert not {"youngs_modulus", "shear_modulus"} & set(draft.get(("cable",)))
    assert draft.cable().axial_stiffness == 2.0


@pytest.mark.parametrize("name", list(PRESETS))
def test_a_preset_is_recognised_whatever_its_length(name):
    assert preset_of({"preset": name, "length": 3.0}) == name
    assert preset_of({**PRESETS[name].values, "length": 3.0}) == name
    assert preset_of({**PRESETS[name].values, "diameter": 0.0123}) == CUSTOM


@pytest.mark.parametrize("name", list(EXAMPLES))
def test_the_first_gripper_that_moves_is_in_hand(name):
    draft = Draft.of(EXAMPLES[name]["value"])
    assert grips.motion(draft) == "moves"


@pytest.mark.parametrize("signed", [False, True])
def test_a_colour_ramp_grows_lighter_from_its_dark_ends(signed):
    light = ramp(np.linspace(0, 1, 11), signed=signed) @ np.array([0.2126, 0.7152, 0.0722])
    assert (np.diff(light[:6]) > 0).all()
    assert (np.diff(light[5:]) > 0).all() if not signed else (np.diff(light[5:]) < 0).all()


def test_a_plot_is_well_formed_whatever_its_words_and_lies_inside_its_frame():
    points = [(0.5, 3e-7), (20.0, 40.0), (800.0, 2e-3)]
    text = plots.plot(
        "t <ms>", 'e & "d"', [plots.Series(name="<b>", points=points, colour="red")], log_x=True, mark="a"
    )
    tree = ET.fromstring(text)
    dots = list(tree.iter("circle"))
    assert len(dots) == 3
    for dot in dots:
        assert plots.LEFT <= float(dot.attrib["cx"]) <= plots.WIDTH - plots.RIGHT
        assert plots.TOP <= float(dot.attrib["cy"]) <= plots.HEIGHT - plots.BOTTOM


def test_the_names_of_a_legend_go_on_in_a_line_below_where_they_are_too_long():
    series = [plots.Series(name=f"the series {k}", points=[(1.0, 1.0)], colour="red") for k in range(4)]
    (legend,) = ET.fromstring(plots.plot("x", "y", series, log_x=True, mark="a")).findall("div")
    assert len(legend) == 4
    assert "flex-wrap: wrap" in legend.attrib["style"]


def test_the_present_solve_is_a_dot_among_what_the_machine_was_calibrated_to():
    prediction = predict(start_draft().scene(NOTHING_STORED))
    common = {"dimensions": 2, "method": "march", "n_t": 13, "steps": 48, "spread": 1e-4, "iterations": 0}
    measured = tuple(
        Measured(n_u=n, wall_time=time, error=error, converged=True, **common)
        for n, time, error in ((7, 1e-3, 1e-2), (9, 2e-3, 1e-3), (8, 3e-3, 5e-3))
    )
    earlier: list[tuple[float, float]] = []
    tree = ET.fromstring(report.accuracy_plot(prediction, earlier, measured))
    assert len(list(tree.iter("circle"))) == 3 + 2 + 1  # all points, the two on the front, and the solve
    assert earlier == [(1e3 * prediction.accuracy.wall_time, 1e3 * prediction.accuracy.error_estimate)]


def test_nothing_to_plot_is_no_plot():
    assert plots.plot("x", "y", [plots.Series(name="", points=[], colour="red")], log_x=False, mark="a") == ""


def test_the_largest_forces_have_their_errors_and_the_table_is_among_them():
    prediction = predict(start_draft().scene(NOTHING_STORED))
    text = "".join(ET.fromstring(report.forces_list(prediction)).itertext())
    (grasp,), (table,) = prediction.grasps, prediction.contacts
    k = int(np.linalg.norm(grasp.reaction, axis=1).argmax())
    assert f"u = {grasp.u:.2f} m: at most {np.linalg.norm(grasp.reaction[k]):.2g}" in text
    assert f" ± {grasp.reaction_error[k]:.1g} N, at {grasp.times[k]:.2f} s" in text
    assert f"table: at most {table.pressed[0]:.2g}" in text


def test_forces_and_reasons_name_an_obstacle_as_the_panel_does():
    prediction = predict(start_draft().scene(NOTHING_STORED))
    (table,) = prediction.contacts
    peg = replace(table, name="obstacles[0]", friction=table.force)
    text = report.forces_list(replace(prediction, report_contacts=lambda: (table, peg)))
    assert "table: at most" in text
    assert "obstacle 1: at most" in text
    assert "obstacle 1, friction: at most" in text
    effect = EffectReport("table", True, "obstacles[1] has no upright walls where the cable lies")
    assert "active: obstacle 2 has no upright walls where the cable lies." in report.effect_note(effect, None)
