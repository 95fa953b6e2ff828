"""Filters of a controller: in the stage file, in continuous time and as a drive carries them out."""

import math
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import sympy as sp
from scipy import signal
from variants import FEEDBACK_FILTERS, FORWARD_FILTERS, a_filter, cascade, gains, lugre, release, stage

import friso
from friso.equations.blocks import Loop
from friso.equations.sampled import sampled_controller
from friso.equations.structure import controller_form
from friso.errors import InputError
from friso.frequency.loops import FORCE, REFERENCE, STAGE, VELOCITY, compensator
from friso.frequency.system import limit_cases
from friso.stage import Stage, numeric_keys
from friso.stage.controllers import FILTER_RULE, FILTERS, FilterSection, filter_forms
from friso.studies.axes import SweptAxis, check_links, linked, read_axis

PLACE = "controller.filters"


def filtered(filters: str, controller: str | None = None) -> Stage:
    gain = 'kind = "pid"\nkp = "1 N/m"\n' if controller is None else controller
    return stage(release(), friction=lugre(2), controller=gain + filters)


def answer(machine: Stage, s: np.ndarray, sees: str = STAGE) -> np.ndarray:
    """Return the response from the measurement to the force."""
    return compensator(machine.flat(), 1).take((sees,), (FORCE,)).at(s)[0, :, 0, 0]


W = 2 * np.pi * 100.0
OMEGA = 2j * np.pi * np.geomspace(1, 1e4, 100)

KINDS: dict[str, tuple[str, Any]] = {
    "notch": (
        a_filter("notch", frequency="100 Hz", width="30 Hz", depth=0.8),
        lambda s: (s**2 + 0.2 * 0.3 * W * s + W**2) / (s**2 + 0.3 * W * s + W**2),
    ),
    "first order": (a_filter("low_pass", frequency="100 Hz"), lambda s: 1 / (1 + s / W)),
    "second order": (
        a_filter("low_pass", frequency="100 Hz", order=2, damping_ratio=0.6),
        lambda s: 1 / (1 + 1.2 * s / W + (s / W) ** 2),
    ),
    "lead": (
        a_filter("lead_lag", zero_frequency="50 Hz", pole_frequency="200 Hz"),
        lambda s: (1 + 2 * s / W) / (1 + s / 2 / W),
    ),
    "biquad": (
        a_filter("biquad", zero_frequency="50 Hz", zero_damping=0.1, pole_frequency="100 Hz", pole_damping=0.7),
        lambda s: (1 + 0.4 * s / W + (2 * s / W) ** 2) / (1 + 1.4 * s / W + (s / W) ** 2),
    ),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_filter_is_its_transfer_function(kind: str) -> None:
    text, by_hand = KINDS[kind]
    assert answer(filtered(text), OMEGA) == pytest.approx(-by_hand(OMEGA), rel=1e-11)


def test_a_notch_takes_its_depth_away_and_is_as_wide_as_stated() -> None:
    deep = filtered(a_filter("notch", frequency="100 Hz", width="30 Hz"))
    assert abs(answer(deep, np.array([1j * W]))[0]) < 1e-12
    half = np.roots([1, 0.3 * W, -(W**2)]).max()  # where the width of 30 Hz ends below
    assert abs(answer(deep, np.array([1j * half]))[0]) == pytest.approx(np.sqrt(0.5))


def test_paths_and_order() -> None:
    """In series they multiply, on either path; in a cascade those of the feedback act on the velocity alone."""
    parts = [by_hand for _, by_hand in KINDS.values()]
    row = filtered("".join(text for text, _ in KINDS.values()))
    assert answer(row, OMEGA) == pytest.approx(-np.prod([part(OMEGA) for part in parts], axis=0), rel=1e-9)
    back = filtered(KINDS["biquad"][0].replace("kind", 'path = "feedback"\nkind'))
    assert answer(back, OMEGA) == pytest.approx(-KINDS["biquad"][1](OMEGA))
    assert answer(back, OMEGA, REFERENCE) == pytest.approx(np.ones(len(OMEGA)))
    loop = filtered(KINDS["biquad"][0].replace("kind", 'path = "feedback"\nkind'), cascade())
    assert answer(loop, OMEGA, STAGE) == pytest.approx(np.full(len(OMEGA), -3000.0))
    assert answer(loop, OMEGA, VELOCITY) == pytest.approx(-50 * KINDS["biquad"][1](OMEGA))


@pytest.mark.slow
def test_bode_of_a_loop_with_filters_is_stable_where_its_poles_are() -> None:
    machine = filtered(
        FORWARD_FILTERS + FEEDBACK_FILTERS, gains(2000, 5000, 60, extra='derivative_on = "measurement"\n')
    )
    closed = friso.linear(machine, part="closed")
    case = friso.bode(machine).cases
    assert {name: bool(item.margins.stable) for name, item in case.items()}["stuck"] == (closed.poles().real.max() < 0)
    assert [*limit_cases(machine.flat())] == [*case]


def commanded(machine: Stage, sample_time: float, errors: np.ndarray) -> np.ndarray:
    """Forces of a drive for errors at its samples."""
    flat = {**machine.flat(), "drive.sample_time": sample_time}
    e, y = sp.symbols("e y", real=True)
    force, held = sampled_controller(controller_form(flat), Loop(e, y, sp.S.Zero, sp.S.Zero), 1)
    parts = (force, *(number.update for number in held))
    keys = {symbol: flat[str(symbol)] for part in parts for symbol in part.free_symbols if str(symbol) in flat}
    once = sp.lambdify(
        [e, y, *keys, *(number.symbol for number in held)],
        parts,
        [{"sine": lambda turns: math.sin(2 * math.pi * turns)}, "math"],
    )
    kept, forces = [0.0] * len(held), []
    for error in errors:
        now, *kept = once(error, 0.0, *keys.values(), *kept)
        forces.append(now)
    return np.array(forces)


@pytest.mark.cases(first=3)
@pytest.mark.parametrize("kind", KINDS)
def test_a_drive_takes_a_filter_by_tustin(kind: str) -> None:
    """The difference equation of SciPy's bilinear transform."""
    text, _ = KINDS[kind]
    machine, t = filtered(text), 1e-3
    errors = np.random.default_rng(1).normal(size=200)
    system = compensator(machine.flat(), 1).take((REFERENCE,), (FORCE,))
    upper, lower = signal.ss2tf(system.a[0], system.b[0], system.c[0], system.d[0])
    assert commanded(machine, t, errors) == pytest.approx(
        signal.lfilter(*signal.bilinear(upper[0], lower, 1 / t), errors), rel=1e-6, abs=1e-7
    )


@pytest.mark.cases(first=2)
@pytest.mark.parametrize("rule", ["backward_euler", "prewarped"])
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "sampled_biquad"])
def test_a_drive_takes_a_filter_by_its_own_rule(kind: str, rule: str) -> None:
    """The difference equation with what the rule puts in the place of s, by SciPy; the same by the drive's key."""
    text, _ = KINDS[kind]
    machine, t = filtered(text), 1e-3
    errors = np.random.default_rng(1).normal(size=200)
    system = compensator(machine.flat(), 1).take((REFERENCE,), (FORCE,))
    upper, lower = (np.ravel(part) for part in signal.ss2tf(system.a[0], system.b[0], system.c[0], system.d[0]))
    exact_at = np.abs(np.roots(lower)).max()
    gain = 1 / t if rule == "backward_euler" else exact_at / np.tan(exact_at * t / 2)
    over = np.poly1d([1, 0]) if rule == "backward_euler" else np.poly1d([1, 1])  # s = gain (z - 1)/over
    parts = [
        sum(
            (np.poly1d([gain, -gain]) ** k * over ** (len(lower) - 1 - k) * float(c) for k, c in enumerate(part[::-1])),
            start=np.poly1d([0.0]),
        )
        for part in (upper, lower)
    ]
    by_hand = signal.lfilter(*(part.coeffs for part in parts), errors)
    ours = commanded(machine.replace({f"{PLACE}.1.discretisation": rule}), t, errors)
    assert ours == pytest.approx(by_hand, rel=1e-6, abs=1e-7)
    assert commanded(machine.replace({"drive.filter_discretisation": rule}), t, errors) == pytest.approx(ours)


def test_a_drive_takes_a_filter_of_a_plug_in_by_its_rule(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only coefficients for samples are taken as they are."""

    class PlainFilter(FilterSection):
        kind: Literal["plain"]

    monkeypatch.setattr(FILTERS, "_classes", {**FILTERS.classes, "plain": PlainFilter})
    flat = {FILTER_RULE: "backward_euler"}
    for number, kind in enumerate(("plain", "sampled_biquad"), start=1):
        flat |= {f"{PLACE}.{number}.kind": kind, f"{PLACE}.{number}.path": "forward"}
    assert [form.discretisation for form in filter_forms(flat, PLACE)] == ["backward_euler", "bilinear"]


def test_a_sampled_biquad_is_its_difference_equation() -> None:
    """At its own sample time it holds to rounding: the numbers of a drive's manual go in and come out."""
    b, a = [0.94, -1.85, 0.93], [-1.85, 0.87]
    machine = filtered(a_filter("sampled_biquad", numerator=b, denominator=a, sample_time="125 us"))
    errors = np.random.default_rng(2).normal(size=500)
    by_hand = np.zeros(502)
    u = np.concatenate([[0.0, 0.0], errors])
    for n in range(2, 502):
        by_hand[n] = b[0] * u[n] + b[1] * u[n - 1] + b[2] * u[n - 2] - a[0] * by_hand[n - 1] - a[1] * by_hand[n - 2]
    assert np.abs(commanded(machine, 125e-6, errors) - by_hand[2:]).max() < 1e-10


# the stage file


@pytest.fixture
def several() -> Stage:
    return filtered(FORWARD_FILTERS + FEEDBACK_FILTERS)


def test_saved_and_loaded_it_is_the_same(several: Stage, tmp_path: Path) -> None:
    friso.save(several, tmp_path / "stage.toml")
    again = friso.load(tmp_path / "stage.toml")
    assert again == several
    assert again.flat() == several.flat()
    assert several.flat()[f"{PLACE}.3.numerator.2"] == -1.85
    assert several.flat()[f"{PLACE}.4.path"] == "feedback"


def test_a_key_of_one_filter_is_set_swept_linked_and_uncertain(several: Stage) -> None:
    one = several.replace({f"{PLACE}.1.frequency": "70 Hz +/- 5 Hz", f"{PLACE}.3.denominator.2": 0.9})
    assert one.flat()[f"{PLACE}.1.frequency"] == 70.0
    assert one.flat()[f"{PLACE}.3.denominator.2"] == 0.9
    assert several.flat()[f"{PLACE}.1.frequency"] == 60.0
    interval = one.uncertain()[f"{PLACE}.1.frequency"]
    assert (interval.low, interval.high) == (65.0, 75.0)
    axis = read_axis(several, f"{PLACE}.1.width", "10 Hz..30 Hz:3", False)
    assert isinstance(axis, SweptAxis) or axis.axis().values == pytest.approx([10.0, 20.0, 30.0])
    link = {"friction.static": f"0.05 * {PLACE}.1.frequency"}
    assert linked(link, {f"{PLACE}.1.frequency": 60.0}) == {"friction.static": pytest.approx(3.0)}
    check_links(several, {f"{PLACE}.4.zero_frequency": f"1.5 * {PLACE}.1.frequency"}, frozenset())
    assert numeric_keys(several.flat())[f"{PLACE}.5.pole_frequency"].unit == "Hz"
    assert several.flat({f"{PLACE}.2.frequency": 250.0})[f"{PLACE}.2.frequency"] == 250.0


def test_a_sweep_into_an_unstable_filter_is_a_violation(several: Stage) -> None:
    flat = several.flat({f"{PLACE}.4.pole_damping": np.array([0.5, -0.5])})
    ((broken, why),) = friso.stage.violations(flat)
    assert list(broken) == [False, True]
    assert "stable" in why


def test_numbers_of_links_take_units() -> None:
    links = {"masses.stage": "0.3 * mass + 20 g", "joint.stroke": "max(2 um, 1e-6)", "joint.stiffness": "2 N/mm * mass"}
    assert linked(links, {"mass": 1.0}) == pytest.approx(
        {"masses.stage": 0.32, "joint.stroke": 2e-6, "joint.stiffness": 2000.0}
    )
    for text, why in (("2 mass", "no usual unit"), ("3 rad/s", "could mean Hz or rad/s"), ("2 m m", "2 m m")):
        with pytest.raises(InputError, match=why):
            linked({"masses.stage": text}, {"mass": 1.0})
