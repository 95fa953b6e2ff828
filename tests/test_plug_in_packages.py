"""Controllers and friction laws from installed packages: found by their entry points, named, and refused."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from friso.errors import InputError
from friso.stage import ControllerSection, register_controller

TESTS = Path(__file__).parent

LAW = '''
"""A friction law of another package."""

from typing import Literal

from friso.stage import FrictionSection, register_friction


@register_friction
class Mine(FrictionSection):
    model: Literal["{name}"]
'''

STAGE = """
masses.cart = "1 kg"
motion = {kind = "step", size = "1 mm", duration = "20 ms"}
[controller]
kind = "pi-d"
bandwidth = "8 Hz"
mass = "1 kg"
"""


def package(folder: Path, name: str, **points: str) -> None:
    """What pip leaves of a package that declares entry points: friso.GROUP = module."""
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = [f"[friso.{group}]\n{module} = {module}\n" for group, module in points.items()]
    (info / "entry_points.txt").write_text("\n".join(lines))


def friso_command(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    paths = os.pathsep.join([str(TESTS.parent), str(folder)])
    return subprocess.run(
        [sys.executable, "-c", "from friso.cli import main; main()", *arguments],
        cwd=folder, capture_output=True, text=True, timeout=600, env={**os.environ, "PYTHONPATH": paths},
    )  # fmt: skip


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    own = (TESTS / "own_controller.py").read_text(encoding="utf-8")
    (tmp_path / "own_controller.py").write_text(f"{own}\nprint('what a plug-in prints is no answer')\n")
    (tmp_path / "air_film.py").write_text(LAW.replace("{name}", "air"))
    package(tmp_path, "other", controllers="own_controller", friction="air_film")
    (tmp_path / "stage.toml").write_text(STAGE)
    return tmp_path


def test_help_names_them(installed: Path) -> None:
    done = friso_command(installed, "--help")
    assert done.returncode == 0, done.stderr
    assert "controller pi-d (own_controller)" in " ".join(done.stdout.split())
    assert "friction law air (air_film)" in " ".join(done.stdout.split())


def test_a_stage_file_uses_one_and_page_and_document_name_it(installed: Path) -> None:
    done = friso_command(installed, "bode", "stage.toml", "--json", "--out", "out")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    (page,) = (Path(file) for file in document["files"] if file.endswith(".html"))
    assert "controller pi-d (own_controller)" in (installed / page).read_text(encoding="utf-8")
    assert "controller pi-d (own_controller)" in document["plug_ins"]


def test_processes_that_compile_and_that_compute_cells_know_one(installed: Path) -> None:
    """Neither imports the package before it is handed a stage with its controller."""
    bandwidths = "controller.bandwidth=8 Hz, 9 Hz"
    done = friso_command(installed, "map", "stage.toml", "--x", bandwidths, "--workers", "2", "--out", "m", "--json")
    assert done.returncode == 0, done.stderr
    outcomes = json.loads(done.stdout)["outcomes"]
    assert sum(outcomes.values()) == 2
    assert not outcomes.get("failed")


@pytest.mark.parametrize(("name", "module"), [("lugre", "taken"), ("air", "missing"), ("air", "leaves")])
def test_a_taken_name_or_a_missing_module_is_one_message(name: str, module: str, tmp_path: Path) -> None:
    (tmp_path / "taken.py").write_text(LAW.replace("{name}", name))
    (tmp_path / "leaves.py").write_text("raise SystemExit(0)")
    package(tmp_path, "other", friction=module)
    done = friso_command(tmp_path, "--help")
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert ('"lugre"' if module == "taken" else "cannot be imported") in done.stderr


def test_a_registered_name_is_refused_in_python() -> None:
    from typing import Literal

    with pytest.raises(InputError, match="a name that is not taken"):

        @register_controller
        class Other(ControllerSection):
            kind: Literal["pid"]


def test_friso_without_packages_loads_nothing() -> None:
    code = "import friso, sys; print('importlib.metadata' in sys.modules and 'sympy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "False"
