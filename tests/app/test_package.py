"""What is installed is what is in the checkout."""

import tomllib

from setuptools import find_packages

from tests.app.conftest import ROOT


def test_every_package_is_installed_and_the_pages_with_them() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    found = find_packages(str(ROOT), include=["app", "app.*", "dlocore", "dlocore.*"])
    assert sorted(settings["packages"]) == sorted([*found, "app.static"])
    assert settings["package-dir"] == {"app.static": "static"}
    assert (ROOT / "static" / "index.html").is_file()
