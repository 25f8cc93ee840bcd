"""The README's Python and JSON are what they say: they run, and they are one scene."""

import json
import re
import runpy
from pathlib import Path

import numpy as np
import pytest

from app.schemas import PredictionRequest, to_scene
from dlocore import predict

README = (Path(__file__).parents[2] / "README.md").read_text()


def blocks(language: str) -> list[str]:
    """Return the blocks of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.DOTALL | re.MULTILINE)


def test_python_example_runs_and_has_fifteen_lines_at_most(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code = blocks("python")[0]
    assert len(code.splitlines()) <= 15
    script = tmp_path / "example.py"
    script.write_text(code)
    names = runpy.run_path(str(script))
    assert names["prediction"].status == "converged"
    assert capsys.readouterr().out.strip()


def test_what_a_planner_asks_for_runs_on_the_scene_of_the_python_example(tmp_path: Path) -> None:
    scene, planner = blocks("python")
    script = tmp_path / "example.py"
    script.write_text(f"{scene}\nother = scene\nscenes = [scene, scene]\n{planner}")
    names = runpy.run_path(str(script))
    assert [names["near"].status, *(found.status for found in names["many"])] == ["converged"] * 3
    assert names["slope"].shape == (1, len(names["t"]), len(names["u"]), 3)


def test_curl_example_is_the_scene_of_the_python_example(tmp_path: Path) -> None:
    script = tmp_path / "example.py"
    script.write_text(blocks("python")[0])
    expected = runpy.run_path(str(script))["prediction"].surface
    body = re.search(r"-d '(\{.*?\})'", README, re.DOTALL)
    assert body is not None
    request = PredictionRequest.model_validate(json.loads(body[1]))
    surface = predict(to_scene(request, lambda id: None)).surface
    # the same scene in the same process: the same arithmetic
    assert np.array_equal(surface.control_points, expected.control_points)


def test_files_that_the_readme_names_exist() -> None:
    root = Path(__file__).parents[2]
    names = re.findall(r"\]\((?!https?:|#)([^)#]+)\)", README)
    assert names
    assert [name for name in names if not (root / name).exists()] == []
