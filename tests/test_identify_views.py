"""What `friso identify` says, writes and draws, on invented results: no engine and no fit is needed."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pages import Page
from snapshots import Snapshots

from friso.identification.combine import combined
from friso.identification.doubt import Quality
from friso.identification.estimate import Estimate, interval_text, value_text, with_interval
from friso.identification.experiments.break_away import static_from_ramps
from friso.identification.experiments.constant_speed import KIND as CONSTANT_SPEED
from friso.identification.experiments.constant_speed import FrictionAtSpeeds
from friso.identification.experiments.moves import KIND as MOVES
from friso.identification.experiments.presliding import bristles_from_presliding
from friso.identification.experiments.slow_sliding import MassOnBristles, stribeck_from_slow_sliding
from friso.identification.inverse_model import inverse_model, motion
from friso.identification.logs.log import Log
from friso.identification.logs.measured_response import MeasuredResponse
from friso.identification.method import Experiment, Identification, Prediction
from friso.identification.moves import IdentifiedMoves, SimulatedLog, SimulationErrors, residual_of
from friso.identification.output_error.fit import OutputErrorFit, first_values
from friso.identification.output_error.identifiable import Profile, coverage
from friso.identification.output_error.parameters import fit_parameters
from friso.identification.output_error.problem import Simulated, loop_problem, tracking
from friso.identification.readings.at_bearing import Between
from friso.identification.readings.common import deflections, record
from friso.identification.readings.friction_position import friction_position
from friso.identification.readings.friction_velocity import friction_velocity
from friso.identification.response.analysis import analyse
from friso.identification.response.masses import two_masses
from friso.identification.sources import LogFile
from friso.identification.stage_file import identified_stage, made_up
from friso.questions.identify.question import IdentifyAnswer
from friso.questions.identify.words import identify_document, identify_figures
from friso.shown.drawing.figure import Figure, Panel, Series
from friso.stage.correlations import Correlations
from friso_thesis.studies.identification.steps import stiffness_from_steps
from friso_thesis.studies.identification.stick_slip import static_from_stick_slip

DT = 1e-3
MASS, VISCOUS, COULOMB = 10.0, 50.0, 8.0
WHY = "no steady motion between 1 and 20 mm/s"
TWO_MASSES = np.array([np.log(1.2), np.log(0.5), np.log(2400.0), np.log(2.0), 0.5, 0.1, 0.0, 0.0, 0.0, 0.0])


def answered(result: Any, files: Any, predictions: Any) -> IdentifyAnswer:
    return IdentifyAnswer(result, inputs=files, predictions=predictions, checked=None)


def moves_log() -> Log:
    """A mass that is driven there and back, its force as its friction and inertia ask for."""
    time = np.arange(4000) * DT
    phase = 2 * np.pi * 0.5 * time
    position, velocity = 0.05 * (1 - np.cos(phase)), 0.05 * np.pi * np.sin(phase)
    force = MASS * 0.05 * np.pi**2 * np.cos(phase) + VISCOUS * velocity + COULOMB * np.sign(velocity)
    force = force + 0.2 * np.random.default_rng(1).standard_normal(len(time))
    return record("axis", DT, position=position, force=force, reference=position)


def moves(own_loop: bool, fitted_in_loop: bool) -> tuple[IdentifiedMoves, Log]:
    """The result of a fit that need not be made."""
    log = moves_log()
    inverse, part = inverse_model(log, 5.0), log.segments[0]
    flat = made_up(log, inverse).flat()
    levels = {name: inverse.value(name) for name in ("mass", "viscous", "coulomb", "offset")}
    parameters = fit_parameters(flat, levels, 0.16, 0.1, True)
    follows = tracking(flat, log, part, parameters, 5.0)
    loop = loop_problem(flat, log, part, parameters) if own_loop else None
    problem = loop if fitted_in_loop and loop else follows
    residual = 0.2 * np.random.default_rng(2).standard_normal(len(log.time))
    core = tuple(i for i, parameter in enumerate(parameters) if parameter.core)
    fit = OutputErrorFit(problem, first_values(parameters), core, 1e-6 * np.eye(len(core)), residual)
    profiles = {
        parameter.name: profile_of(parameter.name, parameter.low, parameter.high, parameter.core, fit.cost)
        for parameter in parameters
    }
    moved = motion(log["position"], DT, 25.0)
    expected = (
        Estimate.normal("friction.coulomb", "N", COULOMB, 0.05, "output error"),
        Estimate.normal("masses.cart", "kg", MASS, 0.02, "output error"),
        Estimate.unknown("friction.static", "N", "output error", WHY, COULOMB, 4 * COULOMB),
        Estimate.unknown("friction.stribeck_velocity", "m/s", "output error", WHY, 5e-5, 0.16),
    )
    result = IdentifiedMoves(
        log=log,
        part=part,
        inverse=inverse,
        by_direction=inverse_model(log, 5.0, by_direction=True),
        fit=fit,
        profiles=profiles,
        estimates=expected,
        correlation=np.eye(2),
        covered=coverage(log["position"], moved, MASS, COULOMB, DT),
        simulated=Simulated(log["position"] + 1e-6, np.gradient(log["position"], DT), log["force"] - residual),
        errors=SimulationErrors(1e-5, 2e-3, 0.05, 0.04) if own_loop else SimulationErrors(np.nan, np.nan, np.nan, 0.04),
        residual=residual_of(residual, moved, DT),
        loop=loop,
        quality=Quality(noise=0.2, left=0.2, noise_left=0.2, inverse_error=0.05, whole_error=0.04),
    )
    return result, log


def profile_of(name: str, low: float, high: float, closed: bool, best: float) -> Profile:
    values = np.linspace(max(low, 1e-9), high, 7)
    cost = best * (1 + 0.1 * (np.arange(7) - 3.0) ** 2) if closed else np.full(7, best)
    cost[-1] = np.inf if closed else best  # a simulation that failed
    return Profile(name, values, cost, 1.1 * best, values[2], values[4], not closed, not closed)


def bench() -> tuple[Any, MeasuredResponse]:
    frequency = np.arange(1.0, 60.0, 0.5)
    rng = np.random.default_rng(3)
    values = two_masses(TWO_MASSES, frequency)[0] * (1 + 0.003 * rng.standard_normal(len(frequency)))
    source = MeasuredResponse(frequency, values, None, "bench", ("118 frequencies",), "m/N")
    return analyse((), measured=source), source


def multisine_bench() -> tuple[Any, tuple[Log, ...]]:
    """Two realisations of a multisine, each with a distortion of its own, in volts."""
    rng, logs, period = np.random.default_rng(4), [], 1000
    lines = np.arange(1, 80)
    for number in range(2):
        spectrum, answers = (np.zeros(period // 2 + 1, complex) for _ in range(2))
        spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines))) * period / 2
        bent = 1 + 0.02 * rng.standard_normal(len(lines))
        answers[lines] = spectrum[lines] * two_masses(TWO_MASSES, lines / (period * 2e-3))[0] * bent
        force, position = (np.tile(np.fft.irfft(item), 5) for item in (spectrum, answers))
        position = position + 1e-3 * position.std() * rng.standard_normal(len(position))
        log = record(f"exp{number + 1}", 2e-3, force=force, position=position)
        logs.append(replace(log, units={"force": "V"}))
    return analyse(logs), tuple(logs)


def steps() -> tuple[Any, Log]:
    level = np.repeat([0.0, 3e-4, 6e-4, 3e-4, 0.0, 3e-4], 1500)
    noise = np.random.default_rng(5).standard_normal((2, len(level)))
    log = record("steps", DT, reference=level, position=level + 1e-7 * noise[0], force=2400 * level + 0.02 * noise[1])
    return stiffness_from_steps(log), log


def stick_slip() -> tuple[Any, Log]:
    """A joint that is drawn on at 1 mm/s while the cart sticks, and lets it go a millimetre within 20 ms."""
    time = np.arange(12000) * DT
    drawn = 1e-3 * time
    sudden = 1e-3 * np.floor(np.maximum(time - 0.2, 0))
    smooth = np.convolve(np.pad(sudden, (10, 9), "edge"), np.ones(20) / 20, "valid")
    noise = 1e-8 * np.random.default_rng(6).standard_normal((2, len(time)))
    cart = smooth + noise[0]
    log = record("slow", DT, position=drawn, cart_position=cart, relative_position=drawn - smooth + noise[1])
    return static_from_stick_slip(log, 2400.0), log


def break_away() -> tuple[Any, Log]:
    """Ramps of several rates to either side, each a segment, of a mass that moves off at 3 N."""
    signals, spans = {"position": [], "force": []}, []
    rng, begin = np.random.default_rng(7), 0
    for number, rate in enumerate((2.0, 4.0, 8.0, 16.0, 3.0, 6.0)):
        time = np.arange(0, 0.3 + 3.2 / rate, DT)
        push = np.maximum(rate * (time - 0.3), 0)
        late = np.maximum(time - (0.3 + 3.0 / rate), 0)
        way = (-1) ** number
        signals["position"].append(way * (0.5 * late**2 * 2 + 1e-8 * rng.standard_normal(len(time))))
        signals["force"].append(way * push + 5e-3 * rng.standard_normal(len(time)))
        spans.append(slice(begin, begin + len(time)))
        begin += len(time)
    arrays = {name: np.concatenate(signal) for name, signal in signals.items()}
    log = replace(record("ramps", DT, **arrays), segments=tuple(spans))
    return static_from_ramps(log), log


def constant() -> tuple[Any, Log]:
    """Return a result and its log of travel over 20 mm at several speeds.

    The friction falls and then rises with the speed.
    """
    legs = [np.zeros(200)]
    for speed in (0.002, 0.004, 0.008, 0.016, 0.032, 0.064):
        leg = np.linspace(0, 0.02, int(0.02 / speed / DT))
        legs += [leg, np.full(200, 0.02), leg[::-1], np.zeros(200)]
    position = np.concatenate(legs)
    velocity = np.gradient(position, DT)
    friction = np.sign(velocity) * (2 + np.exp(-((velocity / 0.006) ** 2))) + 10 * velocity
    friction = friction + 0.05 * np.sin(position * 3000) * np.sign(velocity)
    force = friction + 0.02 * np.random.default_rng(8).standard_normal(len(position))
    log = record("speeds", DT, reference=position, position=position, force=force)
    return FrictionAtSpeeds(friction_velocity(log), friction_position(log)), log


@pytest.mark.slow
def test_where_passes_do_not_repeat_nothing_is_said_of_the_rail() -> None:
    """White noise of the force sensor is no friction along the rail."""
    result, log = constant()
    rail = [name for name, _ in CONSTANT_SPEED.facts(result) if name.startswith("Along the rail")]
    assert len(rail) == len(result.position.passes)
    level = np.sign(np.gradient(log["position"])) * 2.0
    noisy = level + 0.1 * np.random.default_rng(9).standard_normal(len(level))
    white = replace(log, signals={**log.signals, "force": noisy})
    result = FrictionAtSpeeds(friction_velocity(white), friction_position(white))
    assert result.position.passes
    assert not any(name.startswith("Along the rail") for name, _ in CONSTANT_SPEED.facts(result))


def presliding() -> tuple[Any, Log]:
    """A mass on bristles that hardly bend, moved by three sines."""
    time = np.arange(0, 3, DT)
    omega = 2 * np.pi * np.array([[1.7], [11.3], [31.9]])
    position = 1e-6 * np.sin(omega * time).sum(axis=0)
    velocity = 1e-6 * (omega * np.cos(omega * time)).sum(axis=0)
    force = 1e5 * position + 300 * velocity - 1.7e-6 * (omega**2 * np.sin(omega * time)).sum(axis=0)
    log = record("small", DT, position=position, force=force)
    return bristles_from_presliding(log), log


def slow_sliding() -> tuple[Any, Log]:
    """A mass that swings slowly on bristles; nothing else is known to be true of it."""
    step = 2e-4
    time = np.arange(0, 3, step)
    position = 1e-3 * time + 6e-5 * np.sin(60 * time)
    z = deflections(np.diff(position), np.full(len(time) - 1, 1e-5))
    log = record("slow", step, position=position, force=1e5 * z)
    return stribeck_from_slow_sliding(log, Between(delay=0.0), MassOnBristles((1e-3, 0.0), (1e5, 0.0), (0.0, 0.0))), log


Case = tuple[Identification, list[LogFile], list[Prediction]]


@pytest.fixture(scope="module")
def case() -> Case:
    """An identification with every kind of experiment, and a prediction of each kind."""
    moved, log = moves(own_loop=True, fitted_in_loop=True)
    follows, second = moves(own_loop=False, fitted_in_loop=False)
    response, source = bench()
    sines, exps = multisine_bench()
    rows: list[tuple[str, Any, tuple]] = [("frequency", response, (source,)), ("frequency", sines, exps)]
    rows += [("moves", moved, (log,)), ("moves", follows, (second,))]
    others = {"steps": steps, "stick-slip": stick_slip, "break-away": break_away, "constant-speed": constant}
    for kind, make in {**others, "presliding": presliding, "slow-sliding": slow_sliding}.items():
        result, made = make()
        rows.append((kind, result, (made,)))
    experiments = tuple(Experiment(kind, logs, result, moved.estimates) for kind, result, logs in rows)
    estimates = tuple(combined(list(moved.estimates))[0])
    stage = identified_stage(made_up(log, moved.inverse), estimates, ["axis"])
    outcome = Identification(stage, Correlations(), experiments, estimates, ("something <to> know",))
    files = [
        LogFile(Path(f"{item.name}.csv"), item, kind, "as specified", None) for kind, _, logs in rows for item in logs
    ]
    predictions = [
        Prediction(log, "moves", SimulatedLog(moved.part, moved.simulated, moved.errors, 0.02)),
        Prediction(exps[0], "frequency", (0.1, 0.7)),
    ]
    return outcome, files, predictions


@pytest.fixture(scope="module")
def figures(case: Case) -> list[Figure]:
    return identify_figures(case[0], case[2])


# --- numbers ----------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@given(st.floats(1e-7, 1e7), st.floats(1e-5, 0.9), st.sampled_from(["kg", "N", "m", "N s/m", "Hz"]), st.booleans())
@settings(max_examples=150)
def test_rounding_hides_less_than_a_twentieth_of_half_the_interval(
    size: float, share: float, unit: str, negative: bool
) -> None:
    value = -size if negative else size
    result = Estimate("x", unit, value, value - share * size, value + share * size, "")
    number, _, report = value_text(result).partition(" ")
    prefix = {"n": 1e-9, "µ": 1e-6, "m": 1e-3, "k": 1e3, "M": 1e6, "G": 1e9}
    factor = prefix.get(report[0], 1.0) if unit != "kg" and len(report) > len(unit) else 1.0
    rounding = share * size / 20 if "e" not in number else 1e-3 * size
    assert abs(float(number) * factor - value) <= rounding * 1.001


def test_numbers_as_they_are_said(snapshots: Snapshots) -> None:
    """A value has the digits of its interval; of an unknown one it is said what is left possible."""
    known = [
        Estimate(name, unit, value, value - width, value + width, "")
        for name, unit, value, width in (
            ("masses.cart", "kg", 95.281, 0.441),
            ("bias.cart", "N", 0.32, 0.44),
            ("friction.viscous", "N s/m", 210.0, 20.0),
            ("delay", "s", 1.17e-3, 0.2e-3),
            ("mass", "A s^2/rad", 9.53e9, 1.4e8),
            ("friction.coulomb", "N", 20.0, 0.0),
        )
    ]
    ends = (
        (20.0, 79.0, "N"),
        (20.0, np.inf, "N"),
        (0.9e25, np.inf, "N/m"),
        (-np.inf, 3e-3, "m"),
        (4.26e-5, 0.128, "m/s"),
    )
    left = [interval_text(Estimate.unknown("x", unit, "", "a reason", low, high)) for low, high, unit in ends]
    snapshots.check("identify", "numbers", "\n".join([*map(with_interval, known), *left]))


# --- words ------------------------------------------------------------------------------------------------------------


def test_words(case: Case, snapshots: Snapshots) -> None:
    """Only experiments that have no log yet are named as ways to determine what is missing."""
    result, files, predictions = case
    moves_alone = replace(result, experiments=tuple(one for one in result.experiments if one.kind == "moves"))
    bare = replace(result, stage=None, experiments=())
    for name, one in {"all": result, "moves alone": moves_alone, "without a stage": bare}.items():
        answer = answered(one, files if name == "all" else [], predictions if name == "all" else [])
        text = "\n".join([*answer.sentences(), *(answer.details() if name == "all" else [])])
        assert not re.search(r"\bnan\b|\binf\b|None", text)
        snapshots.check("identify", name, re.sub(r"\d[\d.]*(e[-+]\d+)?", "#", text))  # numbers are tested above


# --- the document -----------------------------------------------------------------------------------------------------


def test_the_document_is_plain_json_and_nothing_unknown_has_a_number(case: Case) -> None:
    document = json.loads(json.dumps(identify_document(*case), allow_nan=False))
    assert [log["kind"] for log in document["logs"]] == [log.kind for log in case[1]]
    keys = {estimate["key"]: estimate for estimate in document["estimates"]}
    cart, static = keys["masses.cart"], keys["friction.static"]
    assert cart["value"] == MASS
    assert cart["written"] in case[0].stage.to_toml()
    assert (static["value"], static["reason"]) == (None, WHY)
    assert (static["low"], static["high"]) == (COULOMB, 4 * COULOMB)
    assert document["predictions"][0]["errors"]["force"] == 0.04
    assert document["predictions"][1] == {"log": "exp1", "response_errors": [0.1, 0.7]}
    assert identify_document(replace(case[0], stage=None, experiments=()), case[1], [])["stage"] is None


def test_the_document_of_each_experiment(case: Case) -> None:
    experiments = identify_document(*case)["experiments"]
    own, follows = (one for one in experiments if one["kind"] == "moves")
    by = {experiment["kind"]: experiment for experiment in experiments}
    mass = own["inverse_model"]["mass_kg"]
    assert mass["low"] < mass["value"] < mass["high"]
    assert mass["value"] == pytest.approx(MASS, rel=0.01)
    assert own["inverse_model"]["coulomb_n"]["value"] == pytest.approx(COULOMB, rel=0.02)
    assert {"mass_kg", "viscous_forward_n_s_per_m", "coulomb_backward_n"} <= own["inverse_model_by_direction"].keys()
    assert own["output_error"]["loop"] == "closed"
    assert follows["output_error"]["loop"] == "follows the log"
    assert follows["output_error"]["errors"]["position"] is None
    assert own["output_error"]["profiles"]["mass"]["mean_squares_n2"][-1] is None
    assert own["output_error"]["profiles"]["friction.stribeck_velocity"]["open_low"]
    assert {item["key"] for item in own["not_shown"]} == {"friction.static", "friction.stribeck_velocity"}
    assert by["steps"]["stiffness"]["value"] == pytest.approx(2400, rel=0.01)
    assert by["stick-slip"]["slips"] > 5
    assert len(by["break-away"]["forces_n"]) == 6
    assert by["constant-speed"]["directions"]["both"]["coulomb"]["unit"] == "N"
    masses = {mass["name"]: mass["value"] for mass in experiments[0]["two_masses"]}
    assert masses["driven mass"] == pytest.approx(1.2, rel=0.05)


# --- figures ----------------------------------------------------------------------------------------------------------


def named(figures: list[Figure], name: str) -> Figure:
    return next(figure for figure in figures if figure.name == name)


def figure_of(result: IdentifiedMoves, name: str) -> Figure:
    return named(MOVES.figures(result, (), "identify_m"), f"identify_m_{name}")


def line(panel: Panel, label: str) -> Series:
    return next(item for item in panel.series if item.label == label)


def test_the_friction_map_shows_force_without_inertia_and_the_curve_found() -> None:
    (panel,) = figure_of(moves(own_loop=True, fitted_in_loop=True)[0], "friction").panels
    measured, curve = line(panel, "measured force less inertia"), line(panel, "identified")
    quick = np.abs(measured.x) > 0.02
    truth = COULOMB * np.sign(measured.x) + VISCOUS * measured.x
    assert np.abs(measured.y - truth)[quick].mean() < 0.3  # the noise alone: 0.16
    ends = curve.y[[0, -1]] * [-1, 1]
    assert ends == pytest.approx(COULOMB + VISCOUS * 0.05 * np.pi, rel=0.03)


def test_a_profile_without_ends_or_costs_is_drawn_as_far_as_it_is_known() -> None:
    """A run that fails costs infinitely much, and an interval may be open; neither may lose the answer."""
    result, _ = moves(own_loop=True, fitted_in_loop=True)
    mass = result.profiles["mass"]
    odd = replace(mass, low=-np.inf, high=np.nan, cost=np.array([np.nan, -np.inf, *mass.cost[2:]]))
    (panel,) = figure_of(replace(result, profiles={"mass": odd}), "profiles").panels
    assert [*panel.bands[0].x] == [mass.values[0], mass.values[-1]]


def test_profiles_are_1_where_the_interval_ends() -> None:
    result, _ = moves(own_loop=True, fitted_in_loop=True)
    figure, profile = figure_of(result, "profiles"), result.profiles["mass"]
    mass = next(panel for panel in figure.panels if panel.x.quantity == "Mass")
    assert mass.series[0].y[2:5] == pytest.approx([1, 0, 1])
    assert np.isnan(mass.series[0].y[-1])
    assert tuple(mass.bands[0].x) == (profile.low, profile.high)


@pytest.mark.parametrize("own_loop", [True, False])
def test_the_force_that_opens_the_page_is_of_the_stretch_that_moves_most(own_loop: bool) -> None:
    result, log = moves(own_loop, own_loop)
    place = 0.05 * (1 - np.cos(np.pi * np.clip(log.time - 2.0, 0.0, 1.0)))  # one move, from 2 to 3 s
    halved = replace(log, signals={**log.signals, "position": place})
    quick = replace(result, log=halved, inverse=replace(result.inverse, bandwidth=40.0))
    (panel,) = figure_of(quick, "force").panels
    measured = line(panel, "measured")
    assert measured.x[[0, -1]] == pytest.approx([2.0, 3.0], abs=2 * DT)
    other = line(panel, "simulated" if own_loop else "needed")
    assert np.std(measured.y - other.y) == pytest.approx(0.2, rel=0.1)


def test_fits_lie_on_the_measured_response_in_size_and_turn(figures: list[Figure]) -> None:
    for number in (1, 2):
        above, below = named(figures, f"identify_frequency{number}_bode").panels
        measured, model = line(above, "measured"), line(above, "two masses")
        at = np.exp(np.interp(np.log(model.x), np.log(measured.x), np.log(measured.y)))
        assert np.median(np.abs(model.y / at - 1)) < 0.05
        phase, fitted = below.series[0], below.series[1]
        assert np.median(np.abs(np.interp(fitted.x, phase.x, phase.y) - fitted.y)) < 10
        band = above.bands[0]
        assert (band.low <= measured.y).all()
        assert (band.high >= measured.y).all()
    mass = line(named(figures, "identify_frequency1_bode").panels[0], "mass line")
    assert 1 / (mass.y * (2 * np.pi * mass.x) ** 2) == pytest.approx(mass.y * 0 + 1.7, rel=0.1)


def test_experiments_in_time_are_drawn_with_what_was_found(case: Case, figures: list[Figure]) -> None:
    results = {experiment.kind: experiment.result for experiment in case[0].experiments}
    (panel,) = named(figures, "identify_steps_stiffness").panels
    (slope,) = panel.series
    assert np.diff(slope.y) / np.diff(slope.x) == pytest.approx(results["steps"].stiffness.value)
    assert len(panel.markers[0].x) == len(results["steps"].windows)
    above = named(figures, "identify_stick_slip_slips").panels[0]
    assert sum(len(marker.x) for marker in above.markers) == len(results["stick-slip"].times)
    (speeds,) = named(figures, "identify_constant_speed_velocity").panels
    assert sum(len(marker.x) for marker in speeds.markers) == len(results["constant-speed"].velocity.velocities)
    forward = line(speeds, "fit, forward")
    truth = 2 + np.exp(-((forward.x / 0.006) ** 2)) + 10 * forward.x
    assert forward.y == pytest.approx(truth, abs=0.1)


def test_every_figure_can_be_drawn_and_the_page_opens_offline(case: Case, figures: list[Figure]) -> None:
    assert len({figure.name for figure in figures}) == len(figures)
    page = str(answered(*case).files()["identify.html"])
    assert [figure.name for figure in figures if f'id="figure-{figure.name}"' not in page] == []
    assert all(address.startswith("data:") for address in Page(page).loads)
    assert case[0].stage.to_toml().strip() in Page(page).text
