"""Every example runs as it stands and draws its pictures."""

import runpy
import sys
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
PICTURES = {
    "bend_around_a_peg.py": ("peg.png", ["peg.png"]),
    "paper_figures.py": ("", ["paper-fig1.png", "paper-fig2.png"]),
    "point_cloud.py": ("cloud.png", ["cloud.png"]),
    "reach_a_place.py": ("reach.png", ["reach.png"]),
    "two_grippers.py": ("grippers.png", ["grippers.png"]),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(path.name for path in EXAMPLES.glob("*.py")))
def test_example_draws_its_pictures(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    matplotlib.use("Agg")
    argument, pictures = PICTURES[name]
    monkeypatch.setattr(sys, "argv", [name, str(tmp_path / argument)])
    runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    plt.close("all")
    drawn = {path.name: plt.imread(path) for path in tmp_path.iterdir()}
    assert sorted(drawn) == pictures
    for picture in drawn.values():
        assert picture.std() > 0.05  # a blank page has 0, these pictures 0.15 and more
