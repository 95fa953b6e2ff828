"""Friction laws that are registered outside friso reach the process that builds their kernels."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from friso.engine.kernel import KernelRequest
from friso.equations.imposed import Imposed
from friso.stage.section import PlugIn, plug_in_of, plug_ins
from friso.stage.tables import friction_law

LAW = '''
from typing import Annotated, Literal

from friso.equations.component import Component, key
from friso.equations.friction.common import Friction
from friso.quantities import Quantity, Value, positive
from friso.stage import FrictionSection, register_friction


@register_friction
class Oil(FrictionSection):
    """A film of oil: F = d v."""

    model: Literal["oil"]
    damping: Annotated[Value, Quantity("N*s/m", positive, "2 N*s/m")]

    @staticmethod
    def declare(velocity, variant):
        return Friction(key("friction.damping") * velocity, key("friction.damping"), Component())
'''

STAGE = """stage = friso.loads('''
masses.cart = "1 kg"
friction = {model = "oil", damping = "2 N*s/m"}
controller = {kind = "pid", kp = "101 N/m"}
motion = {kind = "release", displacement = "1 mm", duration = "1 s"}
''')"""

SCRIPT = """
import friso

if __name__ == "__main__":
    STAGE
    run = friso.simulate(stage, 1e-9)
    print(run.position.values[-1])
"""


def run(folder: Path, source: str, **more: str) -> str:
    (folder / "script.py").write_text(source.replace("STAGE", STAGE))
    paths = os.pathsep.join([str(Path(__file__).parent.parent), *more.values()])
    command = [sys.executable, str(folder / "script.py")]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": paths}, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("place", ["script", "module"])
def test_a_law_of_ones_own(place: str, tmp_path: Path) -> None:
    """A mass on a spring with a damper: x = exp(-t) (cos 10 t + sin(10 t)/10) mm."""
    if place == "module":
        (tmp_path / "oil_film.py").write_text(LAW)
    text = run(tmp_path, LAW + SCRIPT if place == "script" else "import oil_film\n" + SCRIPT)
    assert float(text) == pytest.approx(-3.286906e-4, rel=1e-5)


def test_friso_s_own_laws_are_no_plug_ins() -> None:
    assert plug_ins(KernelRequest(Imposed("lugre", None)).sections) == ()
    assert plug_in_of(friction_law("dahl")) is None


def test_a_plug_in_without_a_file_is_refused() -> None:
    with pytest.raises(ImportError, match="nowhere_to_be_found"):
        PlugIn("nowhere_to_be_found", "").load()
