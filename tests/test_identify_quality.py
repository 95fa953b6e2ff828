"""Quality of an identification: intervals that are never empty, noise, model error, and messages on a bad log."""

import math
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter
from snapshots import Snapshots
from variants import VARIANTS

from friso.identification.combine import combined, groups_of, spread_of
from friso.identification.doubt import (
    DOUBTS,
    IMITATED,
    Doubt,
    KeyCase,
    Quality,
    RaisedDoubt,
    RecordCase,
    ValueCase,
    causes,
    judged_keys,
    whole_error,
)
from friso.identification.doubts import controller, values
from friso.identification.doubts import record as differing_halves
from friso.identification.doubts.forces import changes_beside, inverse_reaching
from friso.identification.estimate import Estimate, interval_text, value_text
from friso.identification.inverse_model import InverseModel, directions, inverse_model
from friso.identification.logs.log import Log
from friso.identification.model_error import allowed_for, of_inverse_model, with_model_error
from friso.identification.output_error.fit import (
    OutputErrorFit,
    as_far_off_as_repeated,
    explained_by,
    first_values,
    polished,
)
from friso.identification.output_error.parameters import BRISTLES, FitParameter, fit_parameters
from friso.identification.output_error.problem import Problem, tracking
from friso.identification.readings.common import noise_of, record
from friso.identification.stage_file import (
    estimate_text,
    identified_stage,
    made_up,
    origins,
    with_origins,
)
from friso.intervals import NORMAL_COVERAGE
from friso.progress import silent

DT = 1e-3
MASS, VISCOUS, COULOMB, OFFSET = 6.0, 20.0, 11.0, 0.5
DRAWN = 10_000


def axis(noise: float = 0.05, seconds: float = 8.0, **other: float) -> Log:
    """Two sines of a mass with friction, with noise on its force."""
    numbers = {"mass": MASS, "viscous": VISCOUS, "coulomb": COULOMB, "offset": OFFSET} | other
    time = np.arange(round(seconds / DT)) * DT
    rates = 2 * np.pi * np.array([[0.5], [1.3]])
    position = np.sum(0.05 * np.sin(rates * time), axis=0)
    velocity = np.sum(0.05 * rates * np.cos(rates * time), axis=0)
    acceleration = np.sum(-0.05 * rates**2 * np.sin(rates * time), axis=0)
    force = numbers["mass"] * acceleration + numbers["viscous"] * velocity + numbers["offset"]
    force += numbers["coulomb"] * np.sign(velocity) + noise * np.random.default_rng(4).standard_normal(len(time))
    return record("axis", DT, position=position, force=force)


# --- intervals --------------------------------------------------------------------------------------------------------


def drawn_estimates() -> Iterator[Estimate]:
    """10 000 estimates, with all that arithmetic can make of a value and its ends."""
    rng = np.random.default_rng(9)
    odd = np.array([0.0, -0.0, np.nan, np.inf, -np.inf, 1e-30, 1e30, 1.0])
    for _ in range(DRAWN // 2):
        value = float(10 ** rng.uniform(-9, 9)) * rng.choice([-1, 1])
        deviation = abs(value) * float(10 ** rng.uniform(-18, 1)) * rng.choice([0, 1, 1, 1])
        yield Estimate.normal("friction.coulomb", "N", value, deviation, "drawn")
        numbers = np.where(rng.random(3) < 0.5, rng.choice(odd, 3), value * (1 + deviation * rng.standard_normal(3)))
        yield Estimate("friction.coulomb", "N", *map(float, numbers), "drawn")


@pytest.mark.slow
def test_what_is_determined_has_an_interval_of_some_width_in_numbers_and_in_print() -> None:
    for estimate in drawn_estimates():
        if not estimate.determined:
            assert estimate.reason
            assert math.isnan(estimate.value)
            continue
        assert all(map(math.isfinite, (estimate.value, estimate.low, estimate.high)))
        assert estimate.low < estimate.high
        low, _, rest = interval_text(estimate).partition(" to ")
        if estimate.half_width > 1e-11 * max(
            abs(estimate.low), abs(estimate.high)
        ):  # beyond, all digits of a double are used up
            assert low != rest.split(" ")[0]
        assert value_text(estimate)
        assert " 0 N" not in estimate_text(estimate).partition("+/-")[2]


def test_a_value_of_next_to_nothing_has_no_sign_and_a_mean_some_width() -> None:
    assert estimate_text(Estimate.normal("bias.cart", "N", -0.001, 0.2, "a")).startswith("0.00 N +/- ")
    one = Estimate.normal("masses.cart", "kg", 2.0, 0.0, "a")
    assert not one.determined
    (mean,), _ = combined([one, Estimate.normal("masses.cart", "kg", 2.1, 0.1, "b")])
    assert mean.determined
    assert mean.value == pytest.approx(2.1)


# --- spreads ----------------------------------------------------------------------------------------------------------


def test_white_errors_are_spread_as_least_squares_says() -> None:
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((20_000, 2))
    residual = rng.standard_normal(20_000)
    time = np.arange(20_000) * DT
    groups = groups_of(np.sin(time), np.cos(time), -np.sin(time))
    plain = np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)))
    assert np.sqrt(np.diag(spread_of(columns, residual, groups))) == pytest.approx(plain, rel=0.5)


def test_a_motion_that_is_repeated_says_nothing_new_of_what_the_model_lacks() -> None:
    """An error that is a function of the speed does not average out over ten times as many repetitions."""

    def deviation(periods: int) -> float:
        time = np.arange(periods * 1000) * DT
        velocity, acceleration = np.cos(2 * np.pi * time), -np.sin(2 * np.pi * time)
        columns = np.stack([acceleration, velocity, np.sign(velocity)], axis=1)
        lacking = velocity**3
        left = lacking - columns @ np.linalg.lstsq(columns, lacking, rcond=None)[0]
        groups = groups_of(np.sin(2 * np.pi * time), velocity, acceleration)
        return float(np.sqrt(spread_of(columns, left, groups)[1, 1]))

    assert deviation(20) == pytest.approx(deviation(2), rel=0.3)


# --- quality ----------------------------------------------------------------------------------------------------------

GOOD = Quality(noise=0.05, left=0.05, noise_left=0.05, inverse_error=0.1, whole_error=0.1)
"""The quality of a fit that lacks nothing."""


@cache
def usual() -> tuple[Log, InverseModel]:
    """A log that lacks nothing, and its inverse model."""
    return axis(), inverse_model(axis(), 5.0)


def with_signals(log: Log, **signals: np.ndarray) -> Log:
    return replace(log, signals={**log.signals, **signals})


def key_case(estimates: Sequence[Estimate], flat: dict[str, Any], **seen: Any) -> KeyCase:
    """Return estimates together with a log and its quality, as the checks of an identification take them."""
    size = sum(estimate.determined for estimate in estimates)
    rest: Any = {"log": usual()[0], "inverse": None, "fit": None, "quality": GOOD, "velocity": np.ones(1)}
    rest |= {"flat": flat, "correlation": np.eye(size)}
    return KeyCase(**rest | {"estimates": tuple(estimates)} | seen)


def allowed(
    estimates: Sequence[Estimate],
    quality: Quality,
    inverse: InverseModel | None = None,
    flat: dict[str, Any] | None = None,
    refuses: dict[str, str] | None = None,
    **together: np.ndarray,
) -> KeyCase:
    """Estimates with intervals that allow for what a model lacks."""
    quality = replace(quality, findings=(*quality.findings, RaisedDoubt(refuses=refuses or {})))
    seen = {"inverse": inverse or usual()[1], "quality": quality, **together}
    return allowed_for(key_case(estimates, flat or {"masses.cart": MASS}, **seen))


def of_little_friction(log: Log) -> str:
    """Return the message on too little Coulomb friction in a log, or nothing."""
    return "".join(finding.words for finding in values.find_little_friction(ValueCase(log, inverse_model(log, 5.0))))


@pytest.mark.parametrize("noise", [0.01, 0.05, 0.5])
def test_the_noise_of_a_force_is_found_beside_its_motion(noise: float) -> None:
    assert noise_of(axis(noise)["force"]) == pytest.approx(noise, rel=0.1)


@pytest.mark.parametrize(("noise", "digit"), [(0.18, 0.1), (0.2, 0.5), (0.5, 1.0), (0.3, 0.5)])
def test_the_noise_of_a_force_in_coarse_digits_is_not_taken_for_that_of_the_next_digit(
    noise: float, digit: float
) -> None:
    """The median of rounded values is a whole digit, or the next: noise came out at 0.166 N for 0.23."""
    time = 5e-4 * np.arange(30000)
    force = 10 * np.sin(20 * time) + noise * np.random.default_rng(1).standard_normal(len(time))
    all_of_it = math.hypot(noise, digit / math.sqrt(12))
    assert noise_of(digit * np.round(force / digit)) == pytest.approx(all_of_it, rel=0.12)


def test_digits_count_as_noise_between_instants_and_beside_rounding() -> None:
    assert noise_of(np.round(axis(0.0)["force"])) >= 1 / math.sqrt(12)
    steps = np.round(20 * np.sin(np.arange(20_000) / 2000)) * 0.25
    instants = np.arange(20_000) + np.random.default_rng(1).uniform(-0.3, 0.3, 20_000)
    resampled = np.interp(np.arange(1, 19_999), instants, steps)
    for force in (steps, steps * (1 + 1e-15 * np.cos(np.arange(20_000))), resampled):
        assert noise_of(force) == pytest.approx(0.25 / math.sqrt(12), rel=1e-6)


def test_a_stage_explains_what_its_own_inverse_model_does() -> None:
    log, inverse = usual()
    expected = {"masses.cart": MASS, "friction.viscous": VISCOUS, "bias.cart": -OFFSET}
    flat = {**made_up(log, inverse).flat(), **expected, "friction.coulomb": COULOMB, "friction.static": COULOMB}
    assert whole_error(flat, inverse) == pytest.approx(inverse.error, rel=0.3)
    assert whole_error({**flat, "friction.coulomb": 2 * COULOMB}, inverse) > 5 * inverse.error
    assert whole_error({**flat, "friction.static": 30.0, "friction.stribeck_velocity": 1e-6}, inverse) < 0.1


def test_halves_that_differ_are_named() -> None:
    log, inverse = usual()
    assert not differing_halves.halves(inverse)
    force = np.where(log.time < 4, log["force"], axis(coulomb=2 * COULOMB)["force"])
    inverse = inverse_model(with_signals(log, force=force), 5.0)
    (apart,) = (one for one in differing_halves.halves(inverse) if one.name == "coulomb")
    assert (apart.first, apart.second) == pytest.approx((COULOMB, 2 * COULOMB), rel=0.1)
    sure = Estimate.normal("friction.coulomb", "N", 1.5 * COULOMB, 0.01, "output error")
    findings = tuple(differing_halves.find_differing_halves(ValueCase(log, inverse, lacks=True)))
    (fair,) = allowed([sure], replace(GOOD, findings=findings), inverse).estimates
    assert fair.holds(COULOMB)
    assert fair.holds(2 * COULOMB)
    assert fair.value == sure.value


def test_a_slow_half_is_not_compared_with_a_fast_one() -> None:
    """Only the slow half is on the falling part of the friction curve."""
    slow, fast = axis(), axis()
    position = np.concatenate([0.1 * slow["position"], fast["position"]])
    velocity = np.gradient(position, DT)
    force = MASS * np.gradient(velocity, DT) + VISCOUS * velocity
    force += np.sign(velocity) * (COULOMB + 3 * np.exp(-((velocity / 0.03) ** 2)))
    force += 0.01 * np.random.default_rng(5).standard_normal(len(force))
    assert not differing_halves.halves(inverse_model(record("both", DT, position=position, force=force), 5.0))


def test_a_log_that_changes_while_it_is_taken_says_so_and_its_intervals_hold_it_all() -> None:
    log, inverse = usual()
    assert changes_beside(inverse) is None
    warmer = np.sign(np.gradient(log["position"])) * np.where(log.time > 3, 3.0, 0.0)
    inverse = inverse_model(with_signals(log, force=log["force"] + warmer + 0.5 * log.time), 5.0)
    changes = changes_beside(inverse)
    assert changes.friction == pytest.approx(3.0, rel=0.4)
    assert changes.constant == pytest.approx(0.5 * 8, rel=0.2)
    answers = {one.name: one for one in inverse_reaching(inverse, changes).estimates}
    for name, levels in {"coulomb": (COULOMB, COULOMB + 3), "offset": (OFFSET, OFFSET + 4)}.items():
        assert all(answers[name].holds(level) for level in levels)
    assert answers["mass"].holds(MASS)
    assert answers["viscous"].holds(VISCOUS)


@pytest.mark.parametrize("odd", [0.0, np.nan, np.inf])
def test_a_number_of_which_nothing_is_known_does_not_move_and_hides_nothing(odd: float) -> None:
    wave, line, counted = np.sin(np.arange(500.0)), np.linspace(-1.0, 1.0, 500), np.ones(500)
    noise = 0.01 * np.random.default_rng(1).standard_normal(500)
    explained = explained_by(np.column_stack([wave, odd * counted]), noise - 2 * wave - 3 * line, [line], counted)
    assert [*explained.moved, *explained.sizes] == pytest.approx([2.0, 0.0, 3.0], abs=0.01)


def test_slow_friction_of_a_fit_that_lacks_something_is_not_told() -> None:
    """On slow passes that stick and slip, a Stribeck velocity came out a third too high."""
    flat = made_up(*usual()).flat()
    stribeck = Estimate.normal("friction.stribeck_velocity", "m/s", 2e-3, 1e-4, "output error")
    asymmetry = Estimate.normal("friction.viscous_asymmetry", "", 0.1, 0.01, "output error")
    assert allowed([stribeck], GOOD, flat=flat).estimates == (stribeck,)
    withdrawn, wide = allowed([stribeck, asymmetry], replace(GOOD, left=1.0), flat=flat).estimates
    assert withdrawn.reason == IMITATED
    assert wide.half_width == pytest.approx(2 * asymmetry.half_width)


@pytest.mark.parametrize("lacking", [True, False], ids=["it lacks something", "a coupling bends"])
def test_what_a_model_lacks_may_pass_for_bristles(lacking: bool) -> None:
    names = ("friction.bristle_stiffness", "friction.stribeck_velocity", "friction.bristle_damping")
    estimates = tuple(Estimate.normal(name, "", 1.0, 0.1, "output error") for name in names)
    correlation = np.array([[1.0, 0.2, 0.3], [0.2, 1.0, 0.4], [0.3, 0.4, 1.0]])
    fine = allowed(estimates, GOOD, correlation=correlation)
    assert fine.estimates == estimates
    assert fine.correlation.tolist() == correlation.tolist()
    refuses = {} if lacking else dict.fromkeys(BRISTLES, "a coupling would pass for it")
    wrong = replace(GOOD, left=4 * GOOD.noise_left) if lacking else GOOD
    case = allowed(estimates, wrong, refuses=refuses, correlation=correlation)
    assert [one.determined for one in case.estimates] == [False, True, False]
    assert case.correlation.tolist() == [[1.0]]


@pytest.mark.parametrize(("left", "reported"), [(2.0, True), (4.0, False), (8.2, False)])
def test_bristles_are_reported_only_from_a_fit_that_leaves_little_more_than_noise(left: float, reported: bool) -> None:
    """Play of 49 um on a machine with bristles of 262 kN/m left 8.2 times the noise, and bristles of 31 to 96 kN/m."""
    stiffness = Estimate.normal("friction.bristle_stiffness", "N/m", 63e3, 16e3, "output error")
    (one,) = allowed(
        [stiffness], Quality(noise=0.04, left=left * 0.01, noise_left=0.01, inverse_error=0.1, whole_error=0.1)
    ).estimates
    assert one.determined == reported


def test_intervals_hold_only_values_that_keys_may_have() -> None:
    flat = VARIANTS["rigid"].flat()
    stiffness = Estimate("friction.bristle_stiffness", "N/m", 1e5, -1e4, 3e5, "")
    viscous = Estimate("friction.viscous", "N*s/m", 2.0, -1.0, 5.0, "")
    mass = Estimate("masses.stage", "kg", 2.0, 1.0, 3.0, "")
    asymmetry = Estimate("friction.viscous_asymmetry", "", -0.5, -1.2, 0.2, "")
    assert judged_keys(key_case([asymmetry], flat)).estimates == (asymmetry,)
    correlation = np.array([[1.0, 0.2, 0.3], [0.2, 1.0, 0.4], [0.3, 0.4, 1.0]])
    case = judged_keys(key_case([stiffness, viscous, mass], flat, correlation=correlation))
    bounded, cut, same = case.estimates
    assert (bounded.determined, bounded.low, bounded.high) == (False, 0.0, 3e5)
    assert (cut.value, cut.low, cut.high) == (2.0, 0.0, 5.0)
    assert same == mass
    assert case.correlation.tolist() == [[1.0, 0.4], [0.4, 1.0]]


def test_what_comes_out_negative_is_not_told_and_never_as_next_to_nothing() -> None:
    """A log of -7.8 N of Coulomb friction had "next to nothing", and a range from 0 down to -7.777 N."""
    negative = Estimate("friction.coulomb", "N", -7.8, -7.823, -7.777, "")
    case = judged_keys(key_case([negative], VARIANTS["rigid"].flat()))
    (answer,) = case.estimates
    assert (answer.determined, answer.low, answer.high) == (False, 0.0, np.inf)
    assert case.correlation.size == 0
    assert of_little_friction(axis(coulomb=-7.8))
    assert of_little_friction(axis(1e-3, coulomb=0.0))
    assert of_little_friction(axis(20.0, coulomb=-0.3))
    time = np.arange(4000) * DT
    falling = record("falling", DT, position=time + 0.1 * np.sin(5 * time), force=-7.8 - 2.5 * np.sin(5 * time))
    assert of_little_friction(falling)
    assert not of_little_friction(axis())


def test_model_error_reaches_the_other_model_where_noise_does_not_explain_the_rest() -> None:
    """A fit that leaves as much as the inverse model is no more certain than that; one that leaves a tenth may be."""
    whole = Estimate.normal("friction.coulomb", "N", 12.04, 0.02, "output error")
    inverse = Estimate.normal("coulomb", "N", 10.6, 0.3, "least squares")
    assert with_model_error(whole, inverse, 1.0, 0.0) == whole
    wide = with_model_error(whole, inverse, 1.0, 1.0)
    assert wide.holds(11.2)
    assert wide.value == whole.value
    assert wide.systematic > 0.8
    whole = Estimate.normal("masses.cart", "kg", 95.4, 0.1, "output error")
    inverse = Estimate.normal("mass", "kg", 95.1, 0.5, "least squares")
    assert with_model_error(whole, inverse, 1.0, 1.0).half_width == pytest.approx(inverse.half_width)
    assert with_model_error(whole, inverse, 1.0, 1.0, 0.1).half_width == pytest.approx(whole.half_width)


def test_lacking_is_what_noise_does_not_explain() -> None:
    assert Quality(noise=1.0, left=1.0, noise_left=1.0, inverse_error=0.1, whole_error=0.1).lacking == 0.0
    assert Quality(noise=1.0, left=10.0, noise_left=1.0, inverse_error=0.1, whole_error=0.1).lacking == pytest.approx(
        1.0, abs=0.01
    )
    assert Quality(noise=0.0, left=1.0, noise_left=0.0, inverse_error=0.1, whole_error=0.1).ratio == math.inf


def test_the_inverse_model_steps_in_with_its_values() -> None:
    values = {"masses.cart": 1.0, "friction.coulomb": 1.0, "bias.cart": 9.0, "friction.static": 11.99}
    asked = [Estimate.normal(key, "", value, 0.1, "output error") for key, value in values.items()]
    answers, correlation = of_inverse_model(usual()[1], made_up(*usual()).flat(), asked)
    by_name = {one.name: one for one in answers}
    assert by_name["masses.cart"].value == pytest.approx(MASS, rel=0.01)
    assert by_name["friction.coulomb"].value == pytest.approx(COULOMB, rel=0.05)
    assert by_name["bias.cart"].value == pytest.approx(-OFFSET, abs=0.1)
    assert by_name["bias.cart"].low < by_name["bias.cart"].high
    assert not by_name["friction.static"].determined
    assert correlation.shape == (3, 3)


# --- causes -----------------------------------------------------------------------------------------------------------


def causes_of(log: Log) -> list[RaisedDoubt]:
    return causes(RecordCase(log, inverse_model(log, 5.0)))


def late(log: Log) -> dict[str, np.ndarray]:
    return {"force": np.roll(log["force"], 16)}


def averaged(log: Log) -> dict[str, np.ndarray]:
    return {"force": np.convolve(log["force"], np.full(65, 1 / 65), "full")[: len(log.time)]}


def along_the_way(log: Log) -> dict[str, np.ndarray]:
    return {"force": log["force"] + 8 * np.sin(2 * np.pi * log["position"] / 0.15)}


CAUSES: dict[str, tuple[Callable[[Log], dict[str, np.ndarray]], tuple[str, float, float] | None]] = {
    "late": (late, ("mass", MASS, 0.01)),
    "averaged": (averaged, ("mass", MASS, 0.02)),
    "along the way": (along_the_way, ("coulomb", COULOMB, 0.1)),
    "limited": (lambda log: {"force": np.clip(log["force"], -15, 15)}, None),
    "pushed": (lambda log: {"force": log["force"] + 59.5}, None),
    "shaken": (lambda log: {"force": log["force"] + 8 * np.sin(2 * np.pi * 9.0 * log.time)}, None),
    "jump": (lambda log: {"position": log["position"] - 0.05 * (log.time > 3)}, None),
    "digits": (lambda log: {"position": np.round(log["position"], 3)}, None),
}


@pytest.mark.parametrize("case", CAUSES)
def test_the_cause_of_what_is_left_is_found_and_without_it_the_log_says_what_is_true(
    case: str, snapshots: Snapshots
) -> None:
    change, true = CAUSES[case]
    found = causes_of(with_signals(usual()[0], **change(usual()[0])))
    snapshots.check("identify", f"cause, {case}", "\n".join(cause.words for cause in found))
    assert any(cause.spoils for cause in found) or case != "limited"
    if true:
        name, truth, tolerance = true
        assert found[0].without.value(name) == pytest.approx(truth, rel=tolerance)


def test_noise_has_no_cause() -> None:
    noise = 300 * np.random.default_rng(1).standard_normal(8000)
    assert causes_of(with_signals(usual()[0], force=noise + 0.2 * usual()[0]["force"])) == []


def test_a_feed_forward_that_is_not_logged_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    log, _ = usual()
    ahead = np.roll(log["position"], -20)
    lacking = with_signals(log, reference=ahead, force=log["force"] - 4.0 * np.gradient(np.gradient(ahead, DT), DT))
    inverse = inverse_model(lacking, 5.0)
    cause, case = causes_of(lacking)[0], RecordCase(lacking, inverse)
    assert inverse.value("mass") < 0.5 * MASS
    assert cause.without.value("mass") == pytest.approx(MASS, rel=0.05)
    assert not [*controller.find_perhaps_feedforward(case)]  # it is certain
    monkeypatch.setattr(controller, "lacks_when_fast", lambda *_: False)
    (perhaps,) = controller.find_perhaps_feedforward(case)
    assert perhaps.size == pytest.approx(MASS, rel=0.05)


LAG = 0.02
"""Time constant [s] with which the force of a servo follows."""


def servo_error(force: np.ndarray) -> np.ndarray:
    """The error [m] of a PD servo of 30 N/mm, by its force."""
    return lfilter([DT / (DT + LAG)], [1, -LAG / (DT + LAG)], force) / 3e4


def test_what_friction_does_to_a_servo_that_follows_well_is_no_missing_feedforward() -> None:
    """Friction at low speed is in the difference of reference and position."""
    log, _ = usual()
    velocity = np.gradient(log["position"], DT)
    stribeck = 6.0 * np.exp(-((velocity / 0.1) ** 2)) * np.sign(velocity)
    error = servo_error(axis(noise=0.0)["force"] + stribeck)
    followed = with_signals(log, reference=log["position"] + error, force=log["force"] + stribeck)
    assert np.abs(error).max() < 0.02 * np.ptp(log["position"])
    assert inverse_model(followed, 5.0).value("mass") == pytest.approx(MASS, rel=0.01)
    assert not [cause for cause in causes_of(followed) if cause.without]


@pytest.mark.parametrize("change", ["after", "above", "beyond", "none"])
def test_a_controller_that_changes_its_gains_is_named(change: str) -> None:
    """A PD servo with gains of 0.6 times as much in a part of the record."""
    log, _ = usual()
    position, speed, force = log["position"], np.abs(np.gradient(log["position"], DT)), log["force"]
    parts = {"after": log.time > 3.5, "above": speed > 0.25, "beyond": position > 0.02}
    error = servo_error(force / np.where(parts.get(change, False), 0.6, 1.0))
    followed = with_signals(log, reference=position + error)
    doubts = [*controller.find_changing_gains(RecordCase(followed, inverse_model(followed, 5.0)))]
    assert len(doubts) == (change != "none")
    for doubt in doubts:
        assert doubt.size == pytest.approx(0.6, rel=0.15)


def test_an_integral_that_stands_while_the_force_is_limited_is_no_change_of_gains() -> None:
    time = np.arange(0, 6, DT)
    reference = np.cumsum(np.sin(time) * np.clip(40 * np.sin(2 * np.pi * 0.8 * time), -0.4, 0.4)) * DT
    noise, most = 0.05 * np.random.default_rng(1).standard_normal(len(time)), 30.0
    position, force = np.zeros(len(time)), np.zeros(len(time))
    x = v = total = 0.0
    for k in range(len(time)):
        position[k], error = x, reference[k] - x
        wanted = 8e3 * error + 4e2 * ((reference[k] - reference[k - 1]) / DT - v if k else 0.0) + total
        force[k] = np.clip(wanted, -most, most)
        total += 1e5 * error * DT * (abs(wanted) < most)
        v += DT * (force[k] - COULOMB * np.tanh(v / 1e-3) - VISCOUS * v) / MASS
        x += DT * v
    assert np.mean(np.abs(force) == most) > 0.05
    log = record("limited", DT, position=position, force=force + noise, reference=reference)
    assert not [*controller.find_changing_gains(RecordCase(log, inverse_model(log)))]


def test_much_that_nothing_explains_makes_intervals_wider() -> None:
    inverse = usual()[1]
    one = Estimate.normal("masses.cart", "kg", MASS, 0.1, "output error")
    plain = Quality(noise=0.05, left=1.0, noise_left=0.05, inverse_error=inverse.error, whole_error=inverse.error)
    (same,) = allowed([one], plain).estimates
    (wide,) = allowed([one], replace(plain, spoilt=True, unsettled=True)).estimates
    assert wide.half_width == pytest.approx(2 * same.half_width)


def test_in_one_direction_no_interval_is_narrower_than_the_inverse_models() -> None:
    """The whole model leaves out the constant force there, which acts backward where a stage overshoots."""
    inverse = usual()[1]
    (mass, viscous, coulomb, *rest) = inverse.estimates
    unknown = Estimate.unknown("coulomb", "N", coulomb.method, "one way")
    one_way = replace(inverse, estimates=(mass, viscous, unknown, *rest))
    whole = Estimate.normal("friction.viscous", "N*s/m", VISCOUS, viscous.half_width / 100, "output error")
    quality = Quality(noise=0.05, left=0.0005, noise_left=0.01, inverse_error=inverse.error, whole_error=inverse.error)
    fair, narrow = (allowed([whole], quality, one).estimates[0] for one in (one_way, inverse))
    assert narrow.half_width < 0.5 * viscous.half_width
    assert fair.half_width <= viscous.half_width


def test_a_record_in_pieces_says_how_little_is_fitted() -> None:
    log, inverse = usual()
    assert not [*DOUBTS["gaps"].find(RecordCase(log, inverse))]
    pieces = replace(log, segments=tuple(slice(a, a + 400) for a in range(0, 7600, 401)))
    assert [*DOUBTS["gaps"].find(RecordCase(pieces, inverse))]


# --- the registry -----------------------------------------------------------------------------------------------------


def test_a_doubt_that_is_added_is_asked_in_its_order_and_has_its_consequences() -> None:
    """A new doubt needs one file: here one that refuses the mass, and one that is asked before it."""
    asked = []

    def find(name: str, refuses: dict[str, str]) -> Callable[[KeyCase], Iterator[RaisedDoubt]]:
        def raised(case: KeyCase) -> Iterator[RaisedDoubt]:
            asked.append(name)
            yield RaisedDoubt(refuses=refuses)

        return raised

    mass = Estimate.normal("masses.stage", "kg", 6.0, 0.1, "output error")
    with pytest.MonkeyPatch.context() as patch:
        for name, refuses, after in (("a-load", {"masses.stage": "a load"}, ("z-play",)), ("z-play", {}, ())):
            made_up_doubt = Doubt("key", find(name, refuses), "play", "refused", "a dial gauge", after)
            patch.setitem(DOUBTS.added, name, (made_up_doubt, "made up"))
        case = judged_keys(key_case([mass], VARIANTS["rigid"].flat(), acceleration=np.ones(3)))
    assert asked == ["z-play", "a-load"]
    assert case.estimates[0].reason == "a load"


# --- rests ------------------------------------------------------------------------------------------------------------


def _parameters(flat: dict[str, Any], core: bool = False) -> list[FitParameter]:
    levels = {"mass": MASS, "coulomb": COULOMB, "viscous": VISCOUS, "offset": OFFSET}
    return [one for one in fit_parameters(flat, levels, 0.5, 0.1, True) if one.core or not core]


def problem_of(log: Log, core: bool = True) -> Problem:
    """The problem of a made-up stage that follows a log, with its core parameters, or all."""
    flat = made_up(log, inverse_model(log, 5.0)).flat()
    return tracking(flat, log, log.segments[0], _parameters(flat, core), 5.0)


def test_rests_do_not_count_for_a_stage_that_follows_the_log() -> None:
    log, _ = usual()
    still = np.concatenate([log["position"], np.full(2000, log["position"][-1])])
    still = still + 1e-7 * np.random.default_rng(2).standard_normal(len(still))
    force = np.concatenate([log["force"], np.zeros(2000)])
    problem = problem_of(record("axis", DT, position=still, force=force))
    assert problem.counted[1000:7000].mean() > 0.99
    assert problem.counted[8200:].max() == 0
    assert 0 < problem.noise_left(2.0) < 2.0


@pytest.mark.slow
def test_a_fit_is_no_surer_than_fits_of_simulated_logs_are_off() -> None:
    """A fit with larger residuals than the fits of simulated logs has wider intervals by the same factor.

    With a force in steps of half a newton, a bristle stiffness of 1610 kN/m was given as 770 to 1220 kN/m, without a
    warning.
    """
    log = axis(seconds=4.0)
    problem = problem_of(log)
    free, first = tuple(range(len(problem.parameters))), first_values(problem.parameters)

    def deviations(variance: float, left: float, noise: float) -> np.ndarray:
        fit = OutputErrorFit(problem, first, free, variance * np.eye(len(free)), np.array([left]))
        return np.sqrt(np.diag(as_far_off_as_repeated(fit, log, log.segments[0], 5.0, noise, silent).covariance))

    coulomb = [parameter.name for parameter in problem.parameters].index("friction.coulomb")
    quiet, noisy = (deviations(1e-8, 0.0, noise) for noise in (0.0, 30.0))
    assert (quiet >= 1e-4).all()
    assert noisy[coulomb] > 2 * quiet[coulomb]
    assert noisy[coulomb] > 0.5 * 30.0 / math.sqrt(len(log.time)) / COULOMB
    as_usual, more, twice = (deviations(1e-30, left, 1.0)[coulomb] for left in (0.0, 1e3, 2e3))
    assert more > 2 * as_usual
    assert twice == pytest.approx(2 * more)


@pytest.mark.slow
def test_errors_of_rounding_last_as_long_as_a_force_stays() -> None:
    """Friction at two speeds in digits of 4 N looked alike: viscous friction came out at 1.6 N s/m for 20, +- 0.5."""
    digit = 4.0
    velocity = np.repeat([0.05, -0.05, 0.1, -0.1] * 2, 1000) * (1 - np.exp(-np.tile(np.arange(1000), 8) / 30))
    force = MASS * np.gradient(velocity, DT) + COULOMB * np.tanh(velocity / 1e-3) + VISCOUS * velocity
    log = record("steady", DT, position=np.cumsum(velocity) * DT, force=np.round(force / digit) * digit)
    problem = problem_of(log)
    fitted = polished(problem, tuple(range(len(problem.parameters))), first_values(problem.parameters))
    sure = replace(fitted, covariance=1e-30 * np.eye(len(fitted.free)))
    wide = as_far_off_as_repeated(sure, log, log.segments[0], 5.0, digit / math.sqrt(12), silent)
    off = abs(fitted.value("friction.viscous") - VISCOUS)
    assert off > VISCOUS / 2
    assert wide.deviation[fitted.fitted.index("friction.viscous")] > off / NORMAL_COVERAGE


def test_noise_goes_neither_way() -> None:
    """Over many samples, noise alone goes as far to and fro as the motion does."""
    time = np.arange(20_000) * DT
    blur = 1e-7 * np.random.default_rng(8).standard_normal(len(time))
    assert directions(5e-4 * time + blur) == (True, False)
    assert directions(-5e-4 * time + blur) == (False, True)
    assert directions(5e-4 * np.sin(time) + blur) == (True, True)


# --- the stage file ---------------------------------------------------------------------------------------------------


def test_every_key_says_where_it_comes_from() -> None:
    stage = made_up(*usual())
    estimates = [
        Estimate.normal("friction.coulomb", "N", COULOMB, 0.1, "output error"),
        Estimate.unknown("friction.static", "N", "output error", "no slow motion", COULOMB, 4 * COULOMB),
    ]
    whole = identified_stage(stage, estimates, ["axis"])
    text = with_origins(whole.to_toml(), origins(whole, estimates, {}, None))
    assert tomllib.loads(text) == tomllib.loads(whole.to_toml())
    beside = origins(whole, estimates, {}, ["friction.bristle_stiffness"])
    assert beside["friction.bristle_stiffness"] != beside["friction.viscous"] == beside["controller.crossover"]
