"""Conversion from one friction law to another: what is kept, and what is reported as lost."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from inside import friso_inside
from scipy.integrate import solve_ivp
from variants import DAHL, VARIANTS, elasto_plastic, gms, lugre, rolling, step, stribeck, van_dijk
from variants import stage as stage_with

import friso
from friso.equations.component import Switch, state
from friso.equations.friction.common import direction
from friso.equations.friction.gms import STIFFNESS
from friso.equations.friction.measured import power_law
from friso.errors import InputError
from friso.frequency.members import steady_force
from friso.identification.readings.common import stribeck_curve
from friso.shown.drawing import matplotlib_renderer
from friso.stage import Stage
from friso.stage.lists import element_keys
from friso.stage.tables import friction_law
from friso.studies.laws.conversion import convert, convertible, hysteresis_loop, measure_friction
from friso.studies.laws.virgin import with_virgin_curve

RIG = Path(__file__).parent.parent / "examples" / "thesis_rig.toml"
LUGRE = VARIANTS["rigid"]


def under(friction: str) -> Stage:
    return stage_with(step(), friction=friction, controller=van_dijk())


SLOW = 1e-12
"""Speed [m/s] at which no force depends on it."""

STICKING = [lugre(2), DAHL, elasto_plastic(), elasto_plastic(deflection="2 um"), rolling(), rolling(3.0), gms()]


def slopes(flat: Mapping[str, Any]) -> tuple[Callable[..., Any], Callable[..., Any], int]:
    """Return the law's slopes, its force and its number of states, for a slow forward pull.

    The slopes are the derivatives of the states with respect to displacement; both they and the force are functions of
    the states. An element that slips is at the deflection at which it began to slip.
    """
    law, velocity = friction_law(flat["friction.model"]), state("velocity")
    friction = law.declare(velocity, law.variant(flat))
    states = [item.symbol for item in friction.component.states]
    switches = [kink for kink in friction.component.kinks if isinstance(kink, Switch)]
    sticking = {item.beyond: sp.Piecewise((0, item.enter < 0), (1, True)) for item in switches}
    rates = []
    for item in friction.component.states:
        sticks = sp.prod([1 - side for mode, side in sticking.items() if item.derivative.has(mode)])
        rates.append(item.derivative.subs(dict.fromkeys(sticking, 0)) * sticks / velocity)
    sides = friction.sides({x: x for x in states}) | {direction(velocity).beyond: 1} | dict.fromkeys(sticking, 0)
    values = {velocity: SLOW} | {symbol: flat[str(symbol)] for symbol in _keys(friction, rates) if str(symbol) in flat}
    modules: list[Any] = [{"sine": lambda turns: np.sin(2 * np.pi * turns)}, "numpy"]
    rate, force = (
        sp.lambdify([states], [part.subs(sides).subs(values) for part in parts], modules)
        for parts in (rates, [friction.force])
    )
    return rate, force, len(states)


def _keys(friction: Any, rates: list[Any]) -> set[Any]:
    expressions = [*rates, friction.force, *(kink.surface for kink in friction.component.kinks)]
    return set().union(*(expression.free_symbols for expression in expressions))


@pytest.mark.parametrize("friction", STICKING)
def test_virgin_curves_are_those_of_the_declared_equations(friction: str) -> None:
    """The force over displacement from rest that a law says is measured of it, against its declaration by SciPy."""
    flat = under(friction).flat()
    curve = measure_friction(flat)
    rate, force, count = slopes(flat)
    static = curve.levels.static
    few = curve.displacement[::20][:60]
    step = static / curve.stiffness / 50
    run = solve_ivp(
        lambda _, z: rate(z), (0, few[-1]), np.zeros(count), "DOP853", few, rtol=1e-10, atol=1e-18, max_step=step
    )
    ours = np.interp(few, curve.displacement, curve.force)
    exact = [force(z)[0] for z in run.y.T]
    assert ours == pytest.approx(np.array(exact), abs=1e-5 * static)


def test_the_curve_of_readings_is_that_of_the_laws() -> None:
    flat, speeds = LUGRE.flat(), np.geomspace(1e-5, 1.0, 30)
    levels = [flat[f"friction.{name}"] for name in ("coulomb", "static", "stribeck_velocity", "stribeck_exponent")]
    dry = steady_force(flat, speeds, True) - flat["friction.viscous"] * speeds
    assert stribeck_curve(speeds, *levels) == pytest.approx(dry, rel=1e-12)


@pytest.mark.parametrize("law", ["gms", "elasto_plastic", "rolling"])
def test_a_conversion_there_and_back(law: str) -> None:
    """LuGre's keys come back through any law that keeps them, with what a measurement shows."""
    conversion, flat = convert(LUGRE, law, 6), LUGRE.flat()
    kept = {item.kind for item in conversion.compared if item.kept}
    assert kept >= {"curve", "static", "stiffness", "damping", "viscous"}
    assert (law == "elasto_plastic") == ("virgin" not in kept)
    assert friso.loads(conversion.stage.to_toml()) == conversion.stage
    assert conversion.open
    assert conversion.active
    back = convert(conversion.stage, "lugre").stage.flat()
    friction = {key: flat[key] for key in flat if key.startswith("friction.") and key != "friction.model"}
    assert {key: back[key] for key in friction} == pytest.approx(friction, rel=1e-9)


def test_what_a_law_cannot_keep_is_said() -> None:
    lost = {law: [item.kind for item in convert(LUGRE, law).lost] for law in ("dahl", "stribeck")}
    assert {"static", "curve", "virgin"} <= {*lost["dahl"]}
    assert {"stiffness", "virgin"} <= {*lost["stribeck"]}
    fewer = {item.kind for item in convert(LUGRE, "gms", 2).lost}
    assert "virgin" in fewer
    assert fewer <= {"virgin", "loop area", "loop stiffness"}


def test_a_loop_of_dahl_is_that_of_its_solution() -> None:
    """Along each way the force lacks less and less of sliding friction, F = F_c - (F_c + F_e) exp(-s x / F_c), and
    comes to F_e at the end. A loop that LuGre and GMS share on the way there is not one that they share on the way
    back: "fits the same measurements" was said of 27 in place of 74 uJ."""
    flat, amplitude = under(DAHL).replace({"friction.viscous": "0 N*s/m"}).flat(), 15e-6
    sliding, stiffness = flat["friction.coulomb"], flat["friction.bristle_stiffness"]
    decay = np.exp(-2 * stiffness * amplitude / sliding)
    end = sliding * (1 - decay) / (1 + decay)
    way = 2 * sliding * amplitude - (sliding + end) * sliding / stiffness * (1 - decay)
    loop = hysteresis_loop(flat, amplitude, 1e-6)
    assert loop.area == pytest.approx(2 * way, rel=0.01)
    assert loop.stiffness == pytest.approx(end / amplitude, rel=0.01)
    lost = [item for item in convert(LUGRE, "gms").lost if item.amplitude]
    assert {item.kind for item in lost} >= {"loop area"}
    assert all(item.off > item.allowed for item in lost)


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


def curve_file(folder: Path, displacement: Any, force: Any, heading: str = "displacement [um],force [N]") -> Path:
    rows = "\n".join(f"{x!r},{f!r}" for x, f in zip(map(float, displacement), map(float, force), strict=True))
    path = folder / "virgin.csv"
    path.write_text(f"{heading}\n{rows}\n", encoding="utf-8")
    return path


POINTS_UM, POINTS_N = np.array([0.0, 5, 10, 20, 40, 80, 160, 300]), np.array([0.0, 0.5, 0.9, 1.5, 2.2, 2.7, 2.95, 3.0])


def test_measured_points_are_the_corners_of_maxwell_slip(tmp_path: Path) -> None:
    """Elements side by side go through as many points as there are elements, however stiff the start is; a curve that
    ends early goes on to static friction."""
    conversion = convert(LUGRE, "gms", 7, virgin=curve_file(tmp_path, POINTS_UM, POINTS_N))
    stiffness, share = (
        np.array([v for k, v in conversion.stage.flat().items() if k.startswith(f"friction.element_{name}.")])
        for name in ("stiffness", "share")
    )
    held = np.minimum(stiffness * POINTS_UM[:, None] * 1e-6, share * 3.0).sum(axis=1)
    assert held == pytest.approx(POINTS_N, abs=1e-9)
    assert not conversion.lost
    assert "friction.attraction" in conversion.open
    early = convert(LUGRE, "gms", 7, virgin=curve_file(tmp_path, POINTS_UM[:6], POINTS_N[:6]))
    stiff = convert(LUGRE, "gms", 7, virgin=curve_file(tmp_path, [0.0, 0.1, 50, 100], [0.0, 1, 2.5, 3]))
    assert not stiff.lost
    assert stiff.points is not None
    assert stiff.before.stiffness == pytest.approx(1e7)
    assert stiff.points.stiffness[1] == np.inf  # one point alone shows the first slope
    at = np.array([100e-6, 104e-6, 120e-6])  # it goes on at 12.5 N/mm from 2.7 N
    assert np.interp(at, early.before.displacement, early.before.force) == pytest.approx([2.95, 3.0, 3.0], abs=1e-6)


def test_points_of_a_power_law_give_its_exponent(tmp_path: Path) -> None:
    """Whatever the law of the stage, the same law included."""
    way = np.geomspace(1e-7, 40e-3, 200)
    force = power_law(3.0, 1e5, 1.5, way)
    for law in (lugre(2), rolling(3.0)):
        made = convert(under(law), "rolling", virgin=curve_file(tmp_path, 1e6 * way, force)).stage.flat()
        assert made["friction.rolling_exponent"] == pytest.approx(1.5, abs=0.03)
        assert made["friction.bristle_stiffness"] == pytest.approx(1e5, rel=0.05)


@pytest.mark.parametrize(("noise", "blur"), [(0.003, 0.0), (0.01, 0.0), (0.003, 0.4)])
def test_scatter_does_not_stiffen_the_start(tmp_path: Path, noise: float, blur: float) -> None:
    """Noise of the force, or of the displacement [um], changes the first slope by at most 7 %.

    LuGre, whose curve it is, keeps points with noise of the force alone, but not those of a curve that no set of
    springs has.
    """
    way, rng = np.linspace(0.0, 300.0, 3001), np.random.default_rng(0)
    scatter, seen = 3 * noise * rng.standard_normal(len(way)), way + blur * rng.standard_normal(len(way))
    conversion = convert(LUGRE, "lugre", virgin=curve_file(tmp_path, seen, -3 * np.expm1(-way / 40) + scatter))
    assert conversion.after.stiffness == pytest.approx(75e3, rel=0.07)
    assert conversion.points is not None
    assert blur or conversion.points.scatter == pytest.approx(3 * noise, rel=0.1, abs=1e-4)
    assert blur or "virgin" not in [item.kind for item in conversion.lost]
    convex = convert(LUGRE, "gms", virgin=curve_file(tmp_path, seen, 3 * (way / 300) ** 2 + scatter))
    (virgin,) = (item for item in convex.lost if item.kind == "virgin")
    assert virgin.off > 0.2


def test_the_range_of_the_stiffness_holds_the_truth() -> None:
    """Curves are drawn at random, and one has displacement 0 where the force is not yet 0.

    They have few points or many, evenly spaced or denser near rest.
    """
    rng, shown = np.random.default_rng(11), measure_friction(LUGRE.flat())
    shapes = [lambda w: -np.expm1(-w), lambda w: w / (1 + w), lambda w: np.minimum(w, 1.0), np.tanh]
    held = []
    for number in range(100):
        shape, end = shapes[number % 4], (6, 30, 2, 4)[number % 4]
        count, noise = int(rng.choice([5, 12, 40, 80])), 10 ** rng.uniform(-2.5, -1.5)
        way = np.append(0, rng.choice([np.linspace, np.geomspace])(0.03, end, count))
        force = 3 * shape(way) + 3 * noise * rng.standard_normal(count + 1) * (way > 0)
        _, points = with_virgin_curve(shown, 1e-5 * way, force)
        held.append(points.stiffness[0] <= 3e5 <= points.stiffness[1])
    assert np.mean(held) > 0.92
    way = np.linspace(0, 8, 300)
    force = -3 * np.expm1(-way) + 0.01 * rng.standard_normal(300)
    made, points = with_virgin_curve(shown, 1e-5 * (way + 0.05), force)
    assert made.stiffness < 0.85 * 3e5
    assert points.stiffness[0] <= 3e5 <= points.stiffness[1]


def test_points_leave_what_they_do_not_show_to_the_stage(tmp_path: Path) -> None:
    """The lag of the Maxwell-slip elements stays that of the stage.

    Points that level off slightly below static friction do not lead to springs with hardly any stiffness.
    """
    stage = under(gms())
    levels_off = 0.99 * POINTS_N
    levels_off[-2:] = 2.96, 2.96 + 1e-6
    conversion = convert(stage, "gms", 8, virgin=curve_file(tmp_path, POINTS_UM, levels_off))
    made = conversion.stage.flat()
    assert made["friction.attraction"] == stage.flat()["friction.attraction"]
    assert not conversion.open
    assert not conversion.lost
    slips = [3.0 * made[key.replace("stiffness", "share")] / made[key] for key in element_keys(made, STIFFNESS)]
    assert max(slips) <= 2 * POINTS_UM[-1] * 1e-6 * (1 + 1e-9)


@pytest.mark.parametrize(
    ("heading", "force", "message"),
    [
        ("displacement [um],force [N]", np.array([3.0, 2.94, 2.93, 2.92, 2.91, 2.9, 2.89, 2.88]), "does not rise"),
        ("displacement [um],force [N]", 0.9 * POINTS_N + 0.3, "at displacement 0"),
        ("displacement [um],load [kg]", POINTS_N, "one channel in N"),
        ("displacement [um],force [N]", POINTS_N / 2, "break-away"),
        ("displacement [um],force [N]", -POINTS_N, "does not rise"),
        ("displacement [um],force [N]", POINTS_N, "do not increase"),
    ],
)
def test_refused_points(tmp_path: Path, heading: str, force: np.ndarray, message: str) -> None:
    points = curve_file(tmp_path, POINTS_UM[::-1] if "do not" in message else POINTS_UM, force, heading)
    with pytest.raises(InputError, match=message):
        convert(LUGRE, "gms", virgin=points)


def test_the_command(tmp_path: Path, undrawn: None) -> None:
    done = friso_inside(tmp_path, "convert", RIG, "--friction", "gms", "--elements", "4", "--out", "out", "--json")
    assert done.returncode == 0
    assert all("compiling" in line for line in done.stderr.splitlines())
    document = json.loads(done.stdout)
    assert document["law"] == "gms"
    assert not document["passive"]
    made = friso.load(tmp_path / "out" / "thesis_rig_gms.toml")
    assert sum(name.startswith("friction.element_share") for name in made.flat()) == 4
    assert "none" not in convertible()
    assert {*convertible()} >= {"lugre", "dahl", "stribeck", "elasto_plastic", "gms", "rolling"}
    shown = friso_inside(tmp_path, "convert", RIG, "--friction", "gms")
    assert "[friction]" in shown.stdout
    (figure,) = friso.convert(LUGRE, friction="gms").figures()
    assert matplotlib_renderer.render(figure).axes
    wrong = friso_inside(tmp_path, "convert", RIG, "--friction", "gms", "--elements", "13")
    assert wrong.returncode == 2


@pytest.mark.parametrize("friction", [*STICKING, stribeck(2)])
def test_a_law_converted_to_itself_stays_as_it_is(friction: str) -> None:
    """Only the number of elements may differ; the new elements lag as the old ones."""
    stage = under(friction)
    law = stage.flat()["friction.model"]
    conversion = convert(stage, law, 3)
    assert conversion.stage == stage
    assert not conversion.lost
    assert not conversion.open
    if law == "gms":
        more = convert(stage, law, 6)
        assert more.stage.flat()["friction.attraction"] == stage.flat()["friction.attraction"]
        assert not more.lost
        assert len(element_keys(more.stage.flat(), STIFFNESS)) == 3  # as many as its curve has corners
        assert len(element_keys(convert(stage, law, 2).stage.flat(), STIFFNESS)) == 2
