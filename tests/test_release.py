"""The recipe for conda: what it renders to stands in pyproject.toml and in the version."""

import re
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jinja2
import pytest

from friso.version import VERSION

ROOT = Path(__file__).parents[1]


def test_the_conda_recipe_has_the_requirements_of_the_package() -> None:
    yaml = pytest.importorskip("yaml")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]

    def data(name: str, **_: Any) -> Any:
        return tomllib.loads((ROOT / name).read_text("utf-8"))

    def found_by(name: str, pattern: str, **_: Any) -> Any:
        return re.search(pattern, (ROOT / name).read_text("utf-8"))

    template = jinja2.Template((ROOT / "conda" / "meta.yaml").read_text("utf-8"))
    asked = {"load_file_data": data, "load_file_regex": found_by, "RECIPE_DIR": "conda", "PYTHON": "python"}
    recipe = SimpleNamespace(**yaml.safe_load(template.render(asked)))
    assert recipe.package == {"name": "friso", "version": VERSION}
    python, *needed = recipe.requirements["run"]
    assert python == f"python {project['requires-python']}"
    assert [one.replace("matplotlib-base", "matplotlib") for one in needed] == project["dependencies"]
    assert recipe.build["entry_points"] == [f"{name} = {target}" for name, target in project["scripts"].items()]
    assert recipe.about["license"] == project["license"]
