"""The solver is built in layers: a folder imports only what lies below it, and nothing of the service."""

import ast
from pathlib import Path

import pytest

DLOCORE = Path(__file__).parents[1] / "dlocore"
# folders, and the files beside them, from the ground up
LAYERS = [
    "errors", "words", "machine", "compiling", "effects", "kernels", "spline", "scene", "shape", "problem", "answer",
    "solvers", "stability", "statics", "levels", "prediction", "accuracy", "reference", "front", "many", "planning",
    "balance", "sensitivity", "warming", "calibration", "study", "recordings", "identify",
]  # fmt: skip
FILES = sorted(file for file in DLOCORE.rglob("*.py") if file != DLOCORE / "__init__.py")


def layer_of(parts):
    return LAYERS.index(parts[0].removesuffix(".py"))


def imported(file):
    """Return all modules that a file imports, wherever in it."""
    found = []
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            found += [f"{node.module}.{alias.name}" for alias in node.names]
    return found


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.relative_to(DLOCORE).as_posix())
def test_a_file_imports_only_its_own_layer_and_those_below(file):
    own = layer_of(file.relative_to(DLOCORE).parts)
    for name in imported(file):
        package, *rest = name.split(".")
        assert package not in ("app", "benchmarks", "fastapi", "pydantic", "rerun", "viser"), name
        if package == "dlocore":
            assert layer_of(rest) <= own, f"{name} stands above {LAYERS[own]}"


def test_the_layers_are_those_that_the_readme_tells_of():
    folders = [name for name in LAYERS if (DLOCORE / name).is_dir()]
    assert set(folders) == {path.parent.name for path in DLOCORE.glob("*/__init__.py")}
    table = (DLOCORE.parent / "README.md").read_text().split("### The layers of the solver")[1]
    rows = [line.split("`")[1] for line in table.splitlines() if line.startswith("| `") and "/` |" in line]
    assert [row.rstrip("/") for row in rows if row != "dlocore/"] == folders
