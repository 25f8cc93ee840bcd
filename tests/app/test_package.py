"""What is installed is what is in the checkout."""

import tomllib

from tests.app.conftest import ROOT


def test_every_package_is_installed_and_the_pages_with_them() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    found = [
        ".".join(file.parent.relative_to(ROOT).parts)
        for top in ("app", "dlocore")
        for file in (ROOT / top).rglob("__init__.py")
    ]
    assert sorted(settings["packages"]) == sorted([*found, "app.static"])
    assert settings["package-dir"] == {"app.static": "static"}
    assert (ROOT / "static" / "index.html").is_file()
