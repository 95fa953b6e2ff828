"""Frequency responses from records of known systems, and values read from them: intervals must contain the truth."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from refusals import refused
from scipy import signal
from scipy.linalg import expm

import friso
from friso.frequency.loops import linear
from friso.identification.kinds import KINDS
from friso.identification.logs.log import Log
from friso.identification.logs.measured_response import MeasuredResponse
from friso.identification.response.analysis import analyse, crossovers, departure, feedback, visible
from friso.identification.response.mass_line import mass_lines, straight_lines
from friso.identification.response.masses import fit_one_mass, fit_two_mass, two_masses, widened
from friso.identification.response.modes import fit_modes
from friso.identification.response.records import (
    FrequencyResponse,
    ResponseRecord,
    drift,
    find_periods,
    from_log,
    local_polynomial,
    multisine,
    relative_error,
)
from friso.identification.response.settings import ResponseSettings

DT, PERIOD = 2e-3, 1000  # period of 2 s: lines at 0.5, 1, ... Hz
TRUE = np.array([np.log(1.2), np.log(0.5), np.log(2400.0), np.log(2.0), 0.5, 0.1, 1e-3, 0.0, 0.0, 0.0])

Response = Callable[[np.ndarray], np.ndarray]


def rig(frequency: np.ndarray, which: int = 0) -> np.ndarray:
    return two_masses(TRUE, frequency)[which]


def played(
    rng: np.random.Generator,
    truth: Response,
    lines: np.ndarray,
    periods: int = 6,
    noise: float = 0.0,
    distortion: float = 0.0,
) -> ResponseRecord:
    """A multisine of unit lines through a linear system, with white noise [output's rms] and, line by line, relative
    distortion of the realisation."""
    spectrum = np.zeros(PERIOD // 2 + 1, complex)
    spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines))) * PERIOD / 2
    off = rng.normal(size=(2, len(lines))) / np.sqrt(2)
    answer = np.zeros_like(spectrum)
    answer[lines] = spectrum[lines] * truth(lines / (PERIOD * DT)) * (1 + distortion * (off[0] + 1j * off[1]))
    inputs, output = (np.tile(np.fft.irfft(item), periods) for item in (spectrum, answer))
    return ResponseRecord(inputs, output + noise * np.std(output) * rng.normal(size=len(output)), DT)


def exact(
    truth: Response, frequency: np.ndarray, relative: float, rng: np.random.Generator | None
) -> FrequencyResponse:
    """A response with independent errors of this relative size, known exactly."""
    values, unknown = truth(frequency), np.full(len(frequency), np.nan)
    if rng is not None:
        values = values * (
            1 + relative * (rng.normal(size=len(values)) + 1j * rng.normal(size=len(values))) / np.sqrt(2)
        )
    deviation, many = relative * np.abs(values), np.full(len(frequency), 1e6)
    return FrequencyResponse(
        frequency=frequency,
        response=values,
        deviation=deviation,
        noise=deviation,
        distortion=unknown,
        degrees=many,
        kind="multisine",
    )


# The period


@pytest.mark.parametrize(("before", "after"), [(0, 0), (137, 0), (0, 300), (613, 2500)])
def test_exact_period_and_whole_periods_from_the_end(before: int, after: int) -> None:
    rng = np.random.default_rng(1)
    once = np.fft.irfft(np.r_[0, np.exp(2j * np.pi * rng.random(40)), np.zeros(459)], 997)
    ragged = np.tile(once, 6)[997 - before % 997 :] if before else np.tile(once, 5)
    periods = find_periods(np.concatenate([ragged, np.zeros(after)]))
    assert periods.samples == 997
    assert periods.stop == pytest.approx(len(ragged), abs=20)
    assert periods.count == (periods.stop // 997)
    assert periods.stop - periods.start == periods.count * 997


def test_a_period_is_corrected_and_noise_on_the_input_does_not_move_it() -> None:
    rng = np.random.default_rng(3)
    record = played(rng, rig, np.arange(1, 40))
    corrected = find_periods(record.input, 1004.0)
    assert corrected.samples == PERIOD
    assert find_periods(record.input, 1000.0).warnings == ()
    periods = find_periods(record.input + 0.1 * np.std(record.input) * rng.normal(size=len(record.input)))
    assert (periods.samples, periods.count) == (PERIOD, 6)


def test_drift_leaves_harmonics_alone_and_takes_ramps_away() -> None:
    time = np.arange(6 * PERIOD)
    wave = sum(np.cos(2 * np.pi * k * time / PERIOD + k) for k in (1, 2, 7, 31))
    assert np.abs(drift(wave, PERIOD)).max() < 1e-10
    assert drift(wave + 3 + 0.02 * time, PERIOD) == pytest.approx(3 + 0.02 * time, abs=1e-9)


# Periodic excitation


def share_inside(response: FrequencyResponse, truth: Response = rig) -> float:
    """The share of lines on which the band holds the truth."""
    band, size = response.band(), np.abs(truth(response.frequency))
    return float(np.mean((band.magnitude_low <= size) & (size <= band.magnitude_high)))


@pytest.mark.slow
def test_deviations_hold_the_truth_on_95_percent_of_lines() -> None:
    rng, lines = np.random.default_rng(5), np.arange(2, 60)
    inside: list[tuple[float, float]] = []
    for _ in range(40):
        one = multisine([played(rng, rig, lines, 8, noise=0.05)])
        three = multisine([played(rng, rig, lines, 6, noise=0.02, distortion=0.05) for _ in range(3)])
        inside.append((share_inside(one), share_inside(three)))
    of_noise, of_both = np.mean(inside, axis=0)
    assert of_noise == pytest.approx(0.95, abs=0.02)
    assert of_both == pytest.approx(0.95, abs=0.03)


def test_noise_and_distortion_are_told_apart() -> None:
    rng, lines = np.random.default_rng(6), np.arange(2, 60)
    result = multisine([played(rng, rig, lines, 6, noise=1e-4, distortion=0.1) for _ in range(8)])
    relative = result.distortion / np.abs(result.response) * np.sqrt(8)
    assert np.sqrt(np.mean(relative**2)) == pytest.approx(0.1, rel=0.15)
    quiet = multisine([played(rng, rig, lines, 6, noise=0.02) for _ in range(8)])
    assert np.median(quiet.distortion / quiet.noise) < 1.0
    assert np.sqrt(np.mean((result.deviation**2 - result.noise**2 - result.distortion**2) ** 2)) < 1e-12


def test_one_realisation_says_that_distortion_is_unknown_unless_lines_are_free() -> None:
    rng = np.random.default_rng(7)
    full = multisine([played(rng, rig, np.arange(2, 60), noise=0.01)])
    assert np.isnan(full.distortion).all()
    odd = played(rng, rig, np.arange(1, 60, 2), noise=1e-6)
    bent = ResponseRecord(odd.input, odd.output + 0.2 * odd.output**2 / np.std(odd.output), DT)
    assert np.isfinite(multisine([bent]).distortion).all()
    assert np.median(multisine([bent]).distortion) > 100 * np.median(multisine([odd]).distortion)


def off(response: FrequencyResponse, truth: Response = rig) -> float:
    """The largest relative error of a response."""
    return float(np.abs(response.response / truth(response.frequency) - 1).max())


def test_a_transient_is_left_out_and_a_drift_does_not_matter() -> None:
    rng, lines = np.random.default_rng(8), np.arange(2, 60)
    record = played(rng, rig, lines, 8, noise=1e-3)
    time = np.arange(len(record.output)) * DT
    start = 3 * np.std(record.output) * np.exp(-time / 0.5) * np.cos(60 * time)
    result = multisine([ResponseRecord(record.input, record.output + start + 1e-3 * time, DT)])
    assert any("transient" in text for text in result.warnings)
    assert off(result) < 0.05
    assert not any("transient" in text for text in multisine([record]).warnings)


ONE = played(np.random.default_rng(9), rig, np.arange(2, 60))
HOLED = np.where(np.arange(6000) == 7, np.nan, ONE.output)
LOG = Log("a", np.arange(6000) * DT, DT, {"force": ONE.input}, (slice(0, 6000),), {"force": "V"})


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("call", "key"),
    [
        (lambda: find_periods(np.random.default_rng(4).normal(size=4000)), "period"),
        (lambda: find_periods(np.repeat([0.0, 5.0], 2000)), "period"),
        (lambda: multisine([ONE, ResponseRecord(ONE.input, ONE.output, 2 * DT)]), "records"),
        (lambda: multisine([ONE, played(np.random.default_rng(10), rig, np.arange(80, 99))]), "records"),
        (lambda: multisine([]), "records"),
        (lambda: multisine([ResponseRecord(ONE.input, HOLED, DT)]), "output"),
        (lambda: multisine([ResponseRecord(ONE.input[:-1], ONE.output, DT)]), "record"),
        (lambda: multisine([ResponseRecord(ONE.input[:5], ONE.output[:5], DT)]), "input"),
        (lambda: multisine([ONE]).between(400, 500), "band"),
        (lambda: multisine([ResponseRecord(ONE.input, np.zeros(6000), DT)]), "output"),
        (lambda: multisine([ResponseRecord(ONE.input, ONE.output, 0.0)]), "sample_time"),
        (lambda: relative_error(rig, ONE, (200, 220)), "band"),
        (lambda: fit_modes(exact(rig, np.arange(3.0, 10.0), 0.02, None)), "band"),
        (lambda: from_log(LOG, output="velocity"), "velocity"),
    ],
)
def test_bad_records_and_bands_are_refused(call: Callable[[], object], key: str) -> None:
    with refused(key):
        call()


def test_clocks_that_differ_by_100_ppm_are_accepted_and_named() -> None:
    rng, lines = np.random.default_rng(31), np.arange(2, 60)
    records = [played(rng, rig, lines, noise=1e-3) for _ in range(2)]
    fast = [records[0], ResponseRecord(records[1].input, records[1].output, DT * (1 + 1e-4))]
    response = multisine(fast)
    assert any("100 ppm" in text for text in response.warnings)
    assert off(response) < 0.02
    assert not any("ppm" in text for text in multisine(records).warnings)


def resampled(record: ResponseRecord, lines: np.ndarray, phase: np.ndarray) -> list[np.ndarray]:
    """The signals of a periodic record at other instants, as shares of its period."""
    spectra = [np.fft.rfft(one[:PERIOD])[lines] for one in (record.input, record.output)]
    turning = np.exp(2j * np.pi * np.outer(lines, phase))
    return [2 / PERIOD * np.real(spectrum @ turning) for spectrum in spectra]


@pytest.mark.parametrize("faster", [1e-4, 6e-4])
def test_a_generator_whose_clock_is_not_that_of_the_recorder(faster: float) -> None:
    """A period of 1000.1 or 1000.6 samples, twenty times, beside a record of 1000: their lines are the same."""
    lines = np.arange(2, 60)
    record = played(np.random.default_rng(32), rig, lines, 20)
    slow = resampled(record, lines, np.arange(20 * PERIOD) / (1 + faster) / PERIOD)
    slipping = ResponseRecord(slow[0], slow[1], DT)
    assert off(multisine([slipping])) < 0.02
    assert off(multisine([record, slipping])) < 0.02


def test_weak_lines_are_left_out_and_nothing_left_is_an_error() -> None:
    rng = np.random.default_rng(11)
    result = multisine([played(rng, rig, np.arange(2, 200), noise=0.3)])
    strong = result.usable()
    assert 0 < len(strong.frequency) < len(result.frequency)
    with refused("excitation"):
        multisine([ResponseRecord(ONE.input, rng.normal(size=6000), DT)]).usable(ratio=10)
    assert result.accelerations().response == pytest.approx(-((2 * np.pi * result.frequency) ** 2) * result.response)
    assert result.accelerations().channels.output_unit == "m/s^2"


def test_a_log_becomes_a_record() -> None:
    signals, parts = {"force": ONE.input, "position": ONE.output}, (slice(0, 100), slice(100, 6000))
    record, channels = from_log(replace(LOG, signals=signals, segments=parts))
    assert len(record.input) == 5900
    assert (channels.input_unit, channels.output_unit) == ("V", "m")


# Arbitrary excitation

B, A = signal.zpk2tf([0.5], [0.97 * np.exp(0.5j), 0.97 * np.exp(-0.5j)], 0.05)


def filtered(frequency: np.ndarray) -> np.ndarray:
    return signal.freqz(B, A, 2 * np.pi * frequency * DT)[1]


def test_arbitrary_excitation_holds_the_truth() -> None:
    rng, inside = np.random.default_rng(13), []
    for _ in range(12):
        white = rng.normal(size=20000)
        output = signal.lfilter(B, A, white) + 0.05 * rng.normal(size=20000)
        inside.append(share_inside(local_polynomial(ResponseRecord(white, output, DT)), filtered))
    assert np.mean(inside) == pytest.approx(0.95, abs=0.03)


def test_local_polynomials_are_free_of_the_leakage_that_welch_has() -> None:
    rng = np.random.default_rng(14)
    estimate = rng.normal(size=8000)
    record, length = ResponseRecord(estimate, signal.lfilter(B, A, estimate), DT), {"fs": 1 / DT, "nperseg": 500}
    lines, cross = signal.csd(record.input, record.output, **length)
    welch = lines, cross / signal.welch(record.input, **length)[1]
    local = local_polynomial(record)
    peak = 0.5 / (2 * np.pi * DT)
    worst = [
        np.max(np.abs(response / filtered(frequency) - 1)[np.abs(frequency - peak) < 3])
        for frequency, response in (welch, (local.frequency, local.response))
    ]
    assert worst[1] < 1e-2 < 5e-2 < worst[0]


# Closed loop


def looped(rng: np.random.Generator, size: int, reference: np.ndarray, noise: float = 1.0) -> ResponseRecord:
    """y = G u + v, u = 2 (r - y), G = 0.2 z^-1/(1 - 0.9 z^-1), white noise v."""
    plant = np.array([0.0, 0.2]), np.array([1.0, -0.9])
    closed = plant[1] + 2 * plant[0]
    v = noise * rng.normal(size=size)
    output = signal.lfilter(2 * plant[0], closed, reference) + signal.lfilter(plant[1], closed, v)
    return ResponseRecord(2 * (reference - output), output, DT, reference)


def loop_plant(frequency: np.ndarray) -> np.ndarray:
    return signal.freqz([0.0, 0.2], [1.0, -0.9], 2 * np.pi * frequency * DT)[1]


def test_indirect_estimates_are_right_where_direct_ones_are_not() -> None:
    rng = np.random.default_rng(16)
    record = looped(rng, 40000, rng.normal(size=40000))
    direct = ResponseRecord(record.input, record.output, DT)
    off = [
        np.mean(np.abs(item.response - loop_plant(item.frequency)) / item.deviation)
        for item in map(local_polynomial, (record, direct))
    ]
    assert off[0] < 1.1
    assert off[1] > 2


def test_indirect_multisine_holds_the_truth() -> None:
    rng, inside = np.random.default_rng(17), []
    for _ in range(15):
        records = []
        for _ in range(2):
            once = played(rng, rig, np.arange(2, 100), 1).input
            records.append(looped(rng, 8 * PERIOD, np.tile(once, 8) / np.std(once), noise=0.3))
        inside.append(share_inside(multisine(records), loop_plant))
    assert np.mean(inside) == pytest.approx(0.95, abs=0.03)


def test_feedback_is_noticed_and_not_imagined() -> None:
    rng = np.random.default_rng(18)
    loop = looped(rng, 8000, rng.normal(size=8000))
    assert feedback(ResponseRecord(loop.input, loop.output, DT))
    once = played(rng, rig, np.arange(2, 100), 1).input
    periodic = looped(rng, 8 * PERIOD, np.tile(once, 8) / np.std(once), noise=0.1)
    assert feedback(ResponseRecord(periodic.input, periodic.output, DT))
    white = rng.normal(size=8000)
    coloured = signal.lfilter(*signal.butter(4, 0.2), rng.normal(size=8000))
    for inputs in (white, coloured):
        output = signal.lfilter(B, A, inputs) + 0.1 * rng.normal(size=8000)
        assert feedback(ResponseRecord(inputs, output, DT), direct=True) == ()
        later = np.r_[0.0, output[:-1]]
        assert feedback(ResponseRecord(inputs, later, DT)) == ()
    assert feedback(played(rng, rig, np.arange(2, 60), noise=0.05)) == ()


@pytest.mark.parametrize(("noise", "step"), [(0.02, 0.5), (0.1, 0.25)])
def test_an_open_loop_crosses_once(noise: float, step: float) -> None:
    """Lines closer than the noise pass 0 dB several times."""
    frequency, rng = np.arange(1.0, 100.0, step), np.random.default_rng(28)
    truth, result = np.sqrt(4000.0 / 1.7) / (2 * np.pi), []
    for _ in range(60):
        loop = exact(lambda f: -4000 / (1.7 * (2 * np.pi * f) ** 2), frequency, noise, rng)
        result.append(crossovers(loop))
    assert [len(entry) for entry in result].count(1) >= 57
    assert sum(item[0].holds(truth) for item in result) >= 54


# Lines and modes


def test_mass_lines_of_both_masses() -> None:
    rng = np.random.default_rng(20)
    lines = mass_lines(exact(rig, np.arange(0.5, 100, 0.5), 0.01, rng))
    assert [line.value.holds(mass) for line, mass in zip(lines, (1.7, 1.2), strict=True)] == [True, True]
    assert lines[0].high < 8.0 < 13.0 < lines[1].low


@pytest.mark.slow
def test_mass_line_intervals_hold_the_mass() -> None:
    rng, held = np.random.default_rng(21), 0
    frequency = np.arange(20.0, 200.0, 2.0)
    for _ in range(100):
        wiggle = 0.02 * np.convolve(rng.normal(size=len(frequency) + 8), np.ones(9) / 3, "valid")
        response = exact(lambda f, w=wiggle: -np.exp(w) / (2.5 * (2 * np.pi * f) ** 2), frequency, 0.01, rng)
        (line,) = mass_lines(response, most=1)
        held += line.value.holds(2.5)
    assert held >= 88


@pytest.mark.slow
def test_straight_lines_by_slope_and_sign() -> None:
    frequency = np.geomspace(0.1, 100, 200)
    s = 2j * np.pi * frequency
    for slope, value in ((0, 1 / 300.0), (1, 1 / (5.0 * s)), (2, -1 / (2.0 * s**2))):
        response = exact(lambda _, v=value: v * np.ones(200, complex), frequency, 0.01, np.random.default_rng(22))
        kinds = {kind: straight_lines(response, kind) for kind in range(3)}
        assert [bool(lines) for lines in kinds.values()] == [kind == slope for kind in range(3)]
        (line,) = kinds[slope]
        assert line.value.holds((300.0, 5.0, 2.0)[slope])
        assert line.sign == (-1.0 if slope == 2 else 1.0)


@pytest.mark.slow
def test_modes_and_their_intervals() -> None:
    rng, held = np.random.default_rng(23), {"resonance": 0, "antiresonance": 0}
    antiresonance = np.sqrt(2400 / 0.5) / (2 * np.pi)
    for _ in range(40):
        with ResponseSettings(modes_at_most=1).in_use():
            fit = fit_modes(exact(rig, np.arange(2.0, 40, 1.0), 0.03, rng), rigid=True)
        held["resonance"] += fit["resonance 1 frequency"].holds(antiresonance * np.sqrt(1.7 / 1.2))
        held["antiresonance"] += fit["antiresonance 1 frequency"].holds(antiresonance)
    assert min(held.values()) >= 35


@pytest.mark.slow
def test_the_number_of_modes_is_found_and_said() -> None:
    def three(frequency: np.ndarray) -> np.ndarray:
        s = 2j * np.pi * frequency
        modes = ((11.0, 0.02, 0.4), (60.0, 0.01, 0.3))
        return 0.6 / s**2 + sum(r / (s**2 + 4 * np.pi * f * z * s + (2 * np.pi * f) ** 2) for f, z, r in modes)

    fit = fit_modes(exact(three, np.geomspace(3, 100, 150), 0.02, np.random.default_rng(24)))
    assert (fit.shape.modes, fit.shape.rigid, fit.shape.constant) == (2, True, False)
    for number, (frequency, damping) in enumerate(((11.0, 0.02), (60.0, 0.01)), 1):
        assert fit[f"resonance {number} frequency"].value == pytest.approx(frequency, rel=0.01)
        assert fit[f"resonance {number} damping ratio"].value == pytest.approx(damping, rel=0.2)
    ends = np.array([0.05, 1e6])  # on the mass lines below and above all modes
    assert np.abs(fit.predict(ends)) * (2 * np.pi * ends) ** 2 == pytest.approx([0.6, 1.3], rel=0.02)


@pytest.mark.slow
def test_a_resonance_that_an_antiresonance_nearly_cancels_is_flagged() -> None:
    def with_pair(zero: float) -> Response:
        def response(frequency: np.ndarray) -> np.ndarray:
            s, pole = 2j * np.pi * frequency, 2 * np.pi * 30.0
            one, two = 2 * np.pi * zero, 0.02
            return (s**2 + 2 * two * one * s + one**2) / (s**2 + 2 * two * pole * s + pole**2) / s**2

        return response

    lines = np.geomspace(3, 100, 300)
    near, far = (
        fit_modes(exact(with_pair(zero), lines, 1e-3, np.random.default_rng(25)), rigid=True) for zero in (30.4, 36.0)
    )
    assert any(text.startswith("a resonance at 29.9") and "nearly cancel" in text for text in near.warnings)
    assert not any(text.startswith("a resonance at 29.9") for text in far.warnings)


# Two masses


@pytest.mark.thorough
def test_two_mass_intervals_hold_the_truth() -> None:
    rng, frequency = np.random.default_rng(25), np.arange(3.0, 40.0, 1.0)
    truth = dict(zip(("driven mass", "other mass", "joint stiffness", "joint damping"), np.exp(TRUE[:4]), strict=True))
    held = dict.fromkeys(truth, 0)
    for _ in range(60):
        both = [exact(lambda f, i=i: rig(f, i), frequency, 0.03, rng) for i in (0, 1)]
        fit = fit_two_mass(*both)
        for name, value in truth.items():
            held[name] += fit[name].holds(value)
    assert min(held.values()) >= 53, held


@pytest.mark.slow
def test_two_mass_predicts_another_record_and_signs_are_told() -> None:
    rng, lines = np.random.default_rng(26), np.arange(6, 80)
    first, second = (multisine([played(rng, lambda f, i=i: -rig(f, i), lines, noise=0.01)]) for i in (0, 1))
    fit = fit_two_mass(first, second, (3, 40))
    assert fit.signs == (-1.0, -1.0)
    for collocated, which in ((True, 0), (False, 1)):
        aside = played(rng, lambda f, i=which: -rig(f, i), lines, noise=0.01)
        assert relative_error(lambda f, c=collocated: fit.predict(f, c), aside, (3, 20)) < 0.02
    assert relative_error(lambda f: 0.0 * f, aside, (3, 20)) == pytest.approx(1.0)


def sampled_with_hold(parameters: np.ndarray, frequency: np.ndarray, step: float) -> np.ndarray:
    """Samples of driven and other mass over samples of a force that is held for `step` [s], shape (2, lines)."""
    driven, other, stiffness, damping = np.exp(parameters[:4])
    drag, other_drag = parameters[4:6]
    rates = np.zeros((5, 5))
    rates[[0, 2], [1, 3]] = 1.0
    rates[1] = np.array([-stiffness, -damping - drag, stiffness, damping, 1.0]) / driven
    rates[3] = np.array([stiffness, damping, -stiffness, -damping - other_drag, 0.0]) / other
    over = expm(rates * step)
    states = [
        np.linalg.solve(np.exp(2j * np.pi * line * step) * np.eye(4) - over[:4, :4], over[:4, 4]) for line in frequency
    ]
    return np.array(states)[:, [0, 2]].T


@pytest.mark.cases(first=1, slow=0)
@pytest.mark.parametrize("both", [False, True])
def test_masses_from_a_force_that_is_held_for_an_eighth_of_the_fastest_period(both: bool) -> None:
    """Without a hold in the model the masses came out 1.4 to 1.9 % too large, with intervals of 0.4 to 0.8 %."""
    truth = dict(zip(("driven mass", "other mass", "joint stiffness"), np.exp(TRUE), strict=False))
    truth["total mass"] = truth["driven mass"] + truth["other mass"]
    frequency, rng = np.arange(1.0, 25.0, 0.5), np.random.default_rng(29)
    for step in (5e-3, None):
        values = sampled_with_hold(TRUE, frequency, 5e-3)
        responses = [exact(lambda _, v=v: v, frequency, 1e-3, rng) for v in (values if both else values[:1])]
        fit = fit_two_mass(*(replace(response, sample_time=step) for response in responses))
        assert all(fit[name].holds(value) for name, value in truth.items())
        assert fit["total mass"].half_width < 0.01 * truth["total mass"]
        assert fit["delay"].holds(2.5e-3)


@pytest.mark.parametrize("stiffness", [2.4e3, 3e5, 1e6])
def test_a_force_that_is_held_moves_every_mass_that_is_rigid_at_its_images(stiffness: float) -> None:
    """Joints with their resonance in the band, near and above half the sampling rate (14, 147, 270 Hz of 400 Hz): of
    two outputs on one rigid mass the second had none of the images, and the mass was 0.4 % off."""
    step, frequency = 2.5e-3, np.arange(5.0, 101.0, 5.0)
    truth = TRUE.copy()
    truth[2:4] = np.log([stiffness, 0.02 * np.sqrt(stiffness)])
    truth[6:8] = step / 2, (1e3 * step) ** 2
    right = sampled_with_hold(truth, frequency, step)
    assert np.abs(two_masses(truth, frequency) / right - 1).max() < 1e-4


def test_one_rigid_mass_with_two_outputs_under_a_force_that_is_held() -> None:
    step, frequency, rng = 2.5e-3, np.arange(5.0, 101.0, 5.0), np.random.default_rng(31)
    truth = np.array([*np.log([1.2, 0.5, 1e9, 10.0]), 0.5, 0.1])
    outputs = [exact(lambda _, v=v: v, frequency, 1e-4, rng) for v in sampled_with_hold(truth, frequency, step)]
    one = fit_one_mass([replace(output, sample_time=step) for output in outputs], (1.0, 1.0), (5.0, 100.0))
    assert np.exp(one.parameters[0]) == pytest.approx(1.7, rel=1e-3)


@pytest.mark.thorough
def test_masses_of_a_resonance_low_in_the_band_and_a_sign_that_is_told_first() -> None:
    """The mode lies below the seventh of the band that is fitted at first: masses made up from above it were wrong."""
    truth = dict(zip(("driven mass", "other mass", "joint stiffness"), np.exp(TRUE), strict=False))
    frequency = np.geomspace(2.0, 100.0, 300)
    values = exact(rig, frequency, 1e-4, np.random.default_rng(28)).response
    for sign in (1, -1):
        bench = analyse(
            (),
            measured=MeasuredResponse(frequency, sign * values, None, "", unit="m/N"),
        )
        assert all(bench.two_masses[name].value == pytest.approx(value, rel=1e-3) for name, value in truth.items())
        assert bool(KINDS["frequency"].doubts(bench)) is (sign < 0)
    above = 1.1 * bench.two_masses["antiresonance frequency"].value
    cut = analyse(
        (),
        (above, 100.0),
        measured=MeasuredResponse(frequency, values, None, "", unit="m/N"),
    ).two_masses
    assert all(cut[name].value == pytest.approx(value, rel=1e-2) for name, value in truth.items())


@pytest.mark.thorough
def test_one_mass_without_a_joint_is_not_told_as_two() -> None:
    """Force held between samples of 1 ms was explained by a resonance near or above the band, with certainty."""
    frequency, mass = np.geomspace(1.0, 100.0, 150), 10.0
    s = 2j * np.pi * frequency
    held = -np.expm1(-1e-3 * s) / (1e-3 * s)
    for seed, (drag, spring) in enumerate(((30.0, 0.0), (300.0, 0.0), (3000.0, 0.0), (30.0, 4000.0))):
        truth = held / (mass * s**2 + drag * s + spring)
        values = exact(lambda _, truth=truth: truth, frequency, 1e-3, np.random.default_rng(seed)).response
        bench = analyse((), measured=MeasuredResponse(frequency, values, None, "", unit="m/N"))
        assert bench.two_masses is None
        assert all(line.value.holds(mass) for line in bench.lines)


def test_intervals_grow_where_realisations_scatter() -> None:
    frequency, rng = np.arange(3.0, 40.0, 1.0), np.random.default_rng(27)
    softer = TRUE + np.array([0, 0, 0.2, *np.zeros(len(TRUE) - 3)])
    alike = [fit_two_mass(exact(rig, frequency, 0.01, rng)) for _ in range(2)]
    apart = [alike[0], fit_two_mass(exact(lambda f: two_masses(softer, f)[0], frequency, 0.01, rng))]
    before = alike[0]["joint stiffness"].half_width
    assert widened(alike[0], apart)["joint stiffness"].half_width > 5 * before
    assert widened(alike[0], alike)["joint stiffness"].half_width < 3 * before
    with refused("records"):
        widened(alike[0], alike[:1])


# Friction at low frequency, limit cases


def dragged(frequency: np.ndarray) -> np.ndarray:
    s = 2j * np.pi * frequency
    return 1 / (1.7 * s**2 + 8.0 * s + 20.0)


def test_departure_from_the_mass_line() -> None:
    rng, frequency = np.random.default_rng(28), np.arange(0.2, 20, 0.2)

    def mass_line(f: np.ndarray) -> np.ndarray:
        return -1 / (1.7 * (2 * np.pi * f) ** 2)

    result = departure(exact(dragged, frequency, 0.05, rng), mass_line)
    assert result.frequency.determined
    assert 1.0 < result.frequency.value < 8.0  # damping is a tenth of the inertia force at 7.5 Hz
    assert result.differ is None
    none = departure(exact(mass_line, frequency, 0.05, rng), mass_line)
    assert not none.frequency.determined


@pytest.mark.cases(first=1)
@pytest.mark.parametrize(("cart", "lowest"), [("stuck", 2400 / (1 + 2400 / 1e5)), ("sliding", 1.7)])
def test_limit_cases_are_recognised(cart: str, lowest: float) -> None:
    """The first line is the stiffness to ground, or the whole mass; the last one is the mass of the stage alone."""
    plant = linear(friso.load(friso.example("thesis_rig")).replace({"joint.locked": False, "parasitic": None}), cart)
    row, column = plant.output_labels.index("stage"), plant.input_labels.index("force")

    def truth(frequency: np.ndarray) -> np.ndarray:
        return np.asarray(plant(2j * np.pi * frequency, squeeze=False))[row, column]

    modes = visible(exact(truth, np.geomspace(1.0, 200, 150), 0.02, np.random.default_rng(30)))
    assert modes.case == cart
    assert modes.lines[0].value.value == pytest.approx(lowest, rel=0.05)
    assert modes.lines[-1].value.value == pytest.approx(0.5, rel=0.05)
