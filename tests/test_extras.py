"""Extras: a plain installation has what all commands need, and refuses the others before it computes anything."""

import re
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import friso
from friso.errors import InputError
from friso.platform import installed
from friso.platform.installed import EXTRAS

ROOT = Path(__file__).parents[1]

WITHOUT = f"""
import importlib, pkgutil, sys

class Others:
    def __init__(self, finder):
        self.finder = finder

    def __getattr__(self, name):
        return getattr(self.finder, name)

    def find_spec(self, name, path=None, target=None):
        absent = name.partition(".")[0] in {[*sum(EXTRAS.values(), ()), "h5py"]}
        return None if absent else self.finder.find_spec(name, path, target)

sys.meta_path[:] = map(Others, sys.meta_path)
import friso, friso_thesis

for package in (friso, friso_thesis):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)

axes = {{"controller.crossover": "4 Hz..8 Hz:3"}}
print(friso.sweep(friso.example("thesis_rig"), axes, out=sys.argv[1]).data["outcome"].values.size)
"""
"""Imports all of friso, and fills a store, where no package of an extra can be imported."""


@pytest.mark.slow
def test_no_module_and_no_store_needs_an_extra(tmp_path: Path) -> None:
    command = [sys.executable, "-c", WITHOUT, str(tmp_path / "store")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.split()[-1:]) == (0, ["3"]), done.stderr
    assert friso.read_store(tmp_path / "store")["outcome"].values.size == 3


def test_the_extras_are_those_of_the_package() -> None:
    with open(ROOT / "pyproject.toml", "rb") as file:
        offered = tomllib.load(file)["project"]["optional-dependencies"]
    names = {extra: tuple(re.split(r"[<>=]", line)[0] for line in offered[extra]) for extra in EXTRAS}
    assert names == EXTRAS
    assert {*EXTRAS} <= {*re.split(r"[\[\],]", offered["test"][0])}


@pytest.mark.parametrize(
    ("extra", "asked"),
    [
        ("design", lambda: friso.design(friso.example("thesis_rig"))),
        ("design", lambda: friso.flexure(friso.example("thesis_leaves"))),
        ("design", lambda: friso.reproduce()),
        ("cluster", lambda: friso.sweep(friso.example("thesis_rig"), {"joint.stroke": [1e-3]}, scheduler="tcp://x:1")),
    ],
)
def test_what_needs_an_extra_says_so_before_it_computes(
    monkeypatch: pytest.MonkeyPatch, extra: str, asked: Callable[[], Any]
) -> None:
    monkeypatch.setattr(installed, "is_installed", lambda package: package not in EXTRAS[extra])
    monkeypatch.setattr("friso.engine.batch.run_batch", None)  # nothing runs
    with pytest.raises(InputError) as refused:
        asked()
    assert refused.value.example == f'pip install "friso[{extra}]"'
    assert all(package in refused.value.actual for package in EXTRAS[extra])
