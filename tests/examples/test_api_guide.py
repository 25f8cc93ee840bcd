"""The guide's Python for tension, bends and contacts says what the motion is."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dlocore as dlo

GUIDE = (Path(__file__).parents[2] / "docs" / "api.md").read_text()


def section(title: str) -> str:
    """Return the only block of Python under a heading."""
    (found,) = re.findall(r"^```python\n(.*?)^```", GUIDE.split(f"## {title}\n")[1].split("\n## ")[0], re.DOTALL | re.M)
    return str(found)


def found(**parts: Any) -> dict[str, Any]:
    """Return the names of the guide's block for a cable of 1 m above a table."""
    cable = dlo.Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-4)
    obstacles = parts.pop("obstacles")
    around = dlo.Environment(drag=0.5, table=dlo.Table(height=-1.5), obstacles=obstacles)
    scene = dlo.Scene(cable=cable, environment=around, **parts)
    names: dict[str, Any] = {"scene": scene, "prediction": dlo.predict(scene)}
    exec(section("Tension, bends and contacts"), names)
    return names


def test_the_tension_of_a_hanging_cable_is_the_weight_below() -> None:
    far = dlo.Sphere(center=(1.0, 0.0, 0.0), radius=0.1)
    down = dlo.Straight(direction=(0.0, 0.0, -1.0), settle=True)
    names = found(shape=down, grasps=[dlo.Grasp(u=0.0, hold="tangent")], horizon=0.5, obstacles=(far,))
    weight = 0.05 * 9.81 * (1.0 - names["u"])
    np.testing.assert_allclose(names["tension"][-1], weight, atol=0.02)  # N, of 0.49 N
    np.testing.assert_allclose(names["above_table"][-1, -1], 0.5, atol=5e-3)  # m, of which 4 mm are stretch
    assert not names["touches"].any()


def test_there_may_be_no_obstacle() -> None:
    names = found(shape=dlo.Straight(), grasps=[dlo.Grasp(u=0.0)], horizon=0.2, obstacles=())
    assert names["touches"].shape == (33, 101, 0)


def test_a_cable_that_is_drawn_over_a_bar_touches_it_in_the_middle_and_bends_there() -> None:
    bar = dlo.Cylinder(center=(0.5, 0.0, -0.0425), axis=(0, 1, 0), radius=0.04, height=0.4)  # just below the cable
    ends = [
        dlo.Grasp(u=u, path=dlo.Move(displacement=(inwards, 0.0, -0.2), duration=1.0))
        for u, inwards in ((0.0, 0.05), (1.0, -0.05))
    ]
    names = found(shape=dlo.Straight(), grasps=ends, obstacles=(bar,))
    u, touching = names["u"], names["touches"][-1, :, 0]
    assert touching.any()
    assert np.abs(u[touching] - 0.5).max() < 0.05
    assert names["gaps"][-1, [0, -1], 0].min() > 0.3
    sharpest = names["radius"][-1].argmin()
    assert abs(u[sharpest] - 0.5) < 0.05
    assert names["radius"][-1, sharpest] == pytest.approx(0.0425, rel=0.1)  # m: it lies against the bar
