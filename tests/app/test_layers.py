"""Solver and service are built in layers: a folder imports only what lies below it."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# folders, and the files beside them, from the ground up
LAYERS = {
    "dlocore": [
        "errors", "words", "machine", "files", "array_files", "pickling", "compiling", "effects", "kernels", "spline",
        "scene", "shape", "problem", "answer", "solvers", "stability", "statics", "levels", "balance", "prediction",
        "accuracy", "assembling", "reference", "front", "many", "planning", "sensitivity", "warming", "calibration",
        "study", "recordings", "identify",
    ],
    "app": [
        "settings", "logs", "solids", "svg", "instants", "schemas", "archive", "pages", "http", "recording", "reports",
        "store", "service", "routes", "viewer", "main", "commands", "cli",
    ],
}  # fmt: skip
FOREIGN = {"dlocore": {"app", "benchmarks", "fastapi", "pydantic", "rerun", "viser"}, "app": {"benchmarks"}}
HEADINGS = {"dlocore": "### The layers of the solver", "app": "### The layers of the service"}
FILES = [
    file.relative_to(ROOT) for top in LAYERS for file in sorted((ROOT / top).rglob("*.py")) if file.parent != ROOT / top
] + [file.relative_to(ROOT) for top in LAYERS for file in sorted((ROOT / top).glob("[!_]*.py"))]


def layer_of(package, rest):
    return LAYERS[package].index(rest[0].removesuffix(".py"))


def imported(file):
    """Return all modules that a file imports, wherever in it."""
    found = []
    for node in ast.walk(ast.parse((ROOT / file).read_text())):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            found += [f"{node.module}.{alias.name}" for alias in node.names]
    return found


@pytest.mark.parametrize("file", FILES, ids=Path.as_posix)
def test_a_file_imports_only_its_own_layer_and_those_below(file):
    here, *within = file.parts
    own = layer_of(here, within)
    for name in imported(file):
        package, *rest = name.split(".")
        assert package not in FOREIGN[here], name
        if package == here and rest[0] in LAYERS[here]:  # else a name of the package itself
            assert layer_of(here, rest) <= own, f"{name} stands above {LAYERS[here][own]}"


@pytest.mark.parametrize("top", LAYERS)
def test_the_layers_are_those_that_the_readme_tells_of(top):
    folders = [name for name in LAYERS[top] if (ROOT / top / name).is_dir()]
    assert set(folders) == {path.parent.name for path in (ROOT / top).glob("*/__init__.py")}
    part = (ROOT / "README.md").read_text().split(HEADINGS[top])[1].split("\n#")[0]
    rows = [line.split("`")[1] for line in part.splitlines() if line.startswith("| `") and "/` |" in line]
    assert [row.rstrip("/") for row in rows if row != f"{top}/"] == folders
