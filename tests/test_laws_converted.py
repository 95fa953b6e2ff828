"""From one friction law to another: what is kept, and what is said not to be."""

import json
from pathlib import Path

import numpy as np
import pytest
from inside import friso_inside
from scipy.integrate import solve_ivp
from variants import DAHL, VARIANTS, elasto_plastic, gms, rolling, step, stribeck, van_dijk
from variants import stage as stage_with

import friso
from friso.errors import InputError
from friso.stage import Stage
from friso.studies.laws.conversion import convert, convertible, measured
from friso.views.drawing import matplotlib_renderer

RIG = Path(__file__).parent.parent / "examples" / "thesis_rig.toml"
LUGRE = VARIANTS["rigid"]


def under(friction: str) -> Stage:
    return stage_with(step(), friction=friction, controller=van_dijk())


@pytest.mark.parametrize("friction", [elasto_plastic(), elasto_plastic(deflection="2 um"), rolling(), rolling(3.0)])
def test_virgin_curves_against_scipy(friction: str) -> None:
    """dF/dx of the law moving slowly, by SciPy."""
    flat = under(friction).flat()
    curve, static, stiffness = measured(flat), flat["friction.static"], flat["friction.bristle_stiffness"]

    def slope(_: float, state: np.ndarray) -> list[float]:
        z, most = float(state[0]), static / stiffness
        if flat["friction.model"] == "rolling":
            return [(1 - z / most) ** flat["friction.rolling_exponent"]]
        begins = flat["friction.breakaway_deflection"]
        rising = 0.5 + 0.5 * np.sin(np.pi * (z - (most + begins) / 2) / (most - begins))
        return [1 - (0.0 if z < begins else rising) * z / most]

    few = curve.displacement[::20][:60]
    run = solve_ivp(slope, (0, few[-1]), [0.0], "DOP853", few, rtol=1e-11, atol=1e-18, max_step=static / stiffness / 50)
    ours = np.interp(few, curve.displacement, curve.force)
    assert ours == pytest.approx(stiffness * run.y[0], abs=1e-6 * static)


@pytest.mark.parametrize("law", ["gms", "elasto_plastic", "rolling"])
def test_a_conversion_keeps_what_a_measurement_shows(law: str) -> None:
    conversion = convert(LUGRE, law, 6)
    kept = {item.kind for item in conversion.compared if item.kept}
    assert kept >= {"curve", "static", "stiffness", "damping", "viscous"}
    assert (law == "elasto_plastic") == ("virgin" not in kept)
    assert friso.loads(conversion.stage.to_toml()) == conversion.stage
    assert conversion.open
    assert conversion.active


def test_a_conversion_there_and_back() -> None:
    """LuGre's keys come back through any law that keeps them."""
    for law in ("gms", "elasto_plastic", "rolling"):
        back = convert(convert(LUGRE, law).stage, "lugre").stage.flat()
        flat = LUGRE.flat()
        friction = {
            key: value for key, value in flat.items() if key.startswith("friction.") and key != "friction.model"
        }
        assert {key: back[key] for key in friction} == pytest.approx(friction, rel=1e-9)


def test_what_a_law_cannot_keep_is_said() -> None:
    lost = {law: [item.kind for item in convert(LUGRE, law).lost] for law in ("dahl", "stribeck")}
    assert {"static", "curve", "virgin"} <= {*lost["dahl"]}
    assert {"stiffness", "virgin"} <= {*lost["stribeck"]}
    (fewer,) = convert(LUGRE, "gms", 2).lost
    assert fewer.kind == "virgin"


def test_passive_laws_are_not_warned_of() -> None:
    passive = LUGRE.replace({"friction.viscous": "640 N*s/m"})
    assert not convert(passive, "elasto_plastic").active
    assert "632.5" in convert(LUGRE, "elasto_plastic").active
    assert not convert(under(DAHL), "gms").active


@pytest.mark.parametrize(
    ("stage", "law", "message"),
    [
        (LUGRE, "maxwell", "one of"),
        (under(stribeck(2)), "gms", "does not stick"),
        (under('model = "none"'), "gms", "no friction"),
    ],
)
def test_refused_conversions(stage: Stage, law: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        convert(stage, law)


def test_every_law_but_none_can_be_converted_to() -> None:
    assert {*convertible()} >= {"lugre", "dahl", "stribeck", "elasto_plastic", "gms", "rolling"}
    assert "none" not in convertible()


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matplotlib_renderer, "image", lambda figure, form: b"")
    done = friso_inside(tmp_path, "convert", RIG, "--friction", "gms", "--elements", "4", "--out", "out", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    document = json.loads(done.stdout)
    assert document["law"] == "gms"
    assert not document["passive"]
    made = friso.load(tmp_path / "out" / "thesis_rig_gms.toml")
    assert sum(name.startswith("friction.element_share") for name in made.flat()) == 4
    shown = friso_inside(tmp_path, "convert", RIG, "--friction", "gms")
    assert "[friction]" in shown.stdout
    wrong = friso_inside(tmp_path, "convert", RIG, "--friction", "gms", "--elements", "13")
    assert wrong.returncode == 2


def test_gms_keeps_its_own() -> None:
    conversion = convert(under(gms()), "gms", 3)
    assert not [item for item in conversion.lost if item.kind != "virgin"]
