"""Every example runs as it stands and draws its pictures where it is told to, else where it is started."""

import runpy
import sys
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
PICTURES = {
    "bend_around_a_peg.py": ["bend-around-a-peg.png"],
    "paper_figures.py": ["paper-fig1.png", "paper-fig2.png"],
    "point_cloud.py": ["point-cloud.png"],
    "reach_a_place.py": ["reach-a-place.png"],
    "two_grippers.py": ["two-grippers.png"],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(path.name for path in EXAMPLES.glob("*.py")))
def test_example_draws_its_pictures(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    matplotlib.use("Agg")
    pictures = PICTURES[name]
    monkeypatch.setattr(sys, "argv", [name])
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    plt.close("all")
    drawn = {path.name: plt.imread(path) for path in tmp_path.iterdir()}
    assert sorted(drawn) == pictures
    for picture in drawn.values():
        assert picture.std() > 0.05  # a blank page has 0, these pictures 0.15 and more
    told = capsys.readouterr().out
    assert all(f"drew {picture}\n" in told for picture in pictures)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "argument"), [("point_cloud.py", "cloud.png"), ("paper_figures.py", "")])
def test_an_example_draws_where_it_is_told_to(
    name: str, argument: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    matplotlib.use("Agg")
    monkeypatch.setattr(sys, "argv", [name, str(tmp_path / argument)])
    runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    plt.close("all")
    drawn = sorted(tmp_path.iterdir())
    assert [path.name for path in drawn] == ([argument] if argument else PICTURES[name])
    told = capsys.readouterr().out
    assert all(f"drew {path}\n" in told for path in drawn)
