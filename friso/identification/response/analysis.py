"""Analyse frequency responses of one machine: lines, modes, two masses, effect of friction, and limit cases.

The limit cases of a stage (thesis, Table 1 and Fig. 7) are named in the words of `friso.frequency`. A cart that is
"stuck" makes friction a spring: a stiffness line at low frequency, and with a free joint the mode of the stage on it. A
cart that is "sliding" shows the mass line of cart and stage, and with a free joint an antiresonance and a resonance,
above which the mass line of the stage alone follows. A touched limiter is recognised by its frequencies.

Records also show whether a loop is closed, and a measured open loop shows its crossovers. A measured response may leave
a linear model at low frequency; the frequency where it does is found.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy import stats

from friso.errors import InputError
from friso.identification.estimate import Estimate
from friso.identification.logs.log import Log
from friso.identification.logs.measured_response import MeasuredResponse
from friso.identification.readings.course import external
from friso.identification.response.mass_line import KINDS, StraightLine, mass_lines, straight_lines
from friso.identification.response.masses import TwoMass, fit_two_mass, needs_two, widened
from friso.identification.response.modes import Modes, fit_modes
from friso.identification.response.records import (
    Channels,
    FrequencyResponse,
    ResponseRecord,
    drift,
    find_periods,
    from_log,
    local_polynomial,
    multisine,
    relative_error,
)
from friso.quantities import percent

SAMPLES_OF_A_FEEDBACK_TEST = 600
"""Fewest samples of a test for feedback."""

CHANCE_OF_FEEDBACK = 1e-6
"""Probability (F-test) below which the output counts as predicting the input."""

SHARE_OF_SURPRISE = 0.05
"""Least fraction of the input's unpredicted part that the output must explain."""


def feedback(record: ResponseRecord, direct: bool = False) -> tuple[str, ...]:
    """Return signs that a controller feeds the output back to the input; () for none.

    Without a loop the output's past cannot help to predict the input beyond the input's own past (Granger 1969,
    doi:10.2307/1912791; for feedback: Caines, Chan 1975, doi:10.1109/TAC.1975.1101008). The periodic part of the input
    is removed; an input that repeats exactly contains no reaction. Slow or weak loops stay undetected.

    The present sample of the output counts as past, because a position cannot react to a force within one sample.
    `direct` is true for an output that does, such as an acceleration.
    """
    record = record.checked(SAMPLES_OF_A_FEEDBACK_TEST)
    driven, answer = _surprising(record)
    if driven is None or answer is None:
        return ()
    chance, share = _foretold(driven, answer, direct)
    if chance > CHANCE_OF_FEEDBACK or share < SHARE_OF_SURPRISE:
        return ()
    finding = f"the output predicts {percent(share)} of the innovation of the input (chance {chance:.1g})"
    return (f"{finding}: closed loop, a direct estimate is biased; give the force injected, or a reference that moves",)


DIFFERENCE_OF_PLAYED_PERIODS = 1e-6
"""Relative difference between periods of an input below which it was played from a table."""


def _surprising(record: ResponseRecord) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Return input and output without the part that repeats from period to period.

    If the input does not repeat, both signals are returned unchanged. If nothing is left of the input, both results are
    None.
    """
    try:
        periods = find_periods(record.input)
    except InputError:
        return record.input, record.output
    parts = []
    for values in (record.input, record.output):
        samples = values[periods.start : periods.stop]
        samples = samples - drift(samples, periods.samples)
        parts.append((samples.reshape(periods.count, -1) - samples.reshape(periods.count, -1).mean(axis=0)).ravel())
    if np.std(parts[0]) <= DIFFERENCE_OF_PLAYED_PERIODS * np.std(record.input):
        return None, None
    return parts[0], parts[1]


PAST_OF_THE_INPUT = 60
"""Number of past samples of the input from which the input is predicted."""

PAST_OF_THE_OUTPUT = 8
"""Number of past samples of the output from which the input is predicted."""


def _foretold(driven: np.ndarray, answer: np.ndarray, direct: bool) -> tuple[float, float]:
    """Test whether the past of the output helps to predict the input.

    With `direct`, the present sample of the output is no past. Returns the probability (F-test) that the output's past
    does not help, and the fraction of the input's unpredicted part that it explains.
    """
    own, others, first = PAST_OF_THE_INPUT, PAST_OF_THE_OUTPUT, int(direct)
    target = driven[own:]
    past = [driven[own - lag : -lag] for lag in range(1, own + 1)]
    other = [answer[own - lag : len(answer) - lag] for lag in range(first, others + first)]
    before, after = (_residual_power(target, columns) for columns in (past, past + other))
    free = len(target) - own - others - 1
    if not after > 0:
        return 1.0, 0.0
    statistic = (before - after) / others / (after / free)
    return float(stats.f.sf(statistic, others, free)), float(1 - after / before)


def _residual_power(target: np.ndarray, columns: list[np.ndarray]) -> float:
    """Return the sum of squares that a regression of `target` on columns and a constant leaves."""
    matrix = np.stack([np.ones(len(target)), *columns], axis=1)
    matrix /= np.linalg.norm(matrix, axis=0)
    residual = target - matrix @ np.linalg.lstsq(matrix, target, rcond=1e-13)[0]
    return float(residual @ residual)


def crossovers(loop: FrequencyResponse) -> tuple[Estimate, ...]:
    """Return the frequencies [Hz] at which |L| passes 1, each with its interval, rising.

    Crossovers are interpolated in logarithms; their intervals follow from the interval of the magnitude and the slope
    over nearby lines. Three passages (or five, ...) that noise does not separate count as one. Returns () without a
    crossover.
    """
    size, place = np.log(np.abs(loop.response)), np.log(loop.frequency)
    band = loop.band()
    groups: list[list[tuple[float, float, float]]] = []
    for i in np.flatnonzero(np.sign(size[:-1]) * np.sign(size[1:]) < 0):
        part = slice(max(i - 2, 0), i + 4)
        slope = float(np.polyfit(place[part], size[part], 1)[0])
        share = size[i] / (size[i] - size[i + 1])
        centre = place[i] + share * (place[i + 1] - place[i])
        half = np.log(band.magnitude_high[i : i + 2] / np.abs(loop.response[i : i + 2])).max() / max(abs(slope), 1e-3)
        if not groups or centre - half > max(high for _, _, high in groups[-1]):
            groups.append([])
        groups[-1].append((centre - half, centre, centre + half))
    passages = [passage for group in groups for passage in ([_merged_passage(group)] if len(group) % 2 else group)]
    method, crossed = "where the open loop passes 0 dB", enumerate(np.exp(passages).reshape(-1, 3).tolist(), 1)
    return tuple(Estimate(f"crossover {n}", "Hz", centre, low, high, method) for n, (low, centre, high) in crossed)


def _merged_passage(group: list[tuple[float, float, float]]) -> tuple[float, float, float]:
    """Merge passages through 1 into one: the middle one's frequency, and the range of all."""
    return min(low for low, _, _ in group), group[len(group) // 2][1], max(high for _, _, high in group)


@dataclass(frozen=True)
class Departure:
    """Where a response leaves its linear model at low frequency.

    Below `frequency` [Hz] the response differs from the model. `excess` (lines,) is |G/G_model| at all frequencies
    `lines` [Hz]. `differ` tells whether realisations differ below `frequency` by more than noise (chance below 1 %),
    None with a single realisation. `ratio` is their scatter there relative to the noise.
    """

    frequency: Estimate
    lines: np.ndarray
    excess: np.ndarray
    differ: bool | None
    ratio: float


LINES_OF_A_WINDOW = 9
"""Number of neighbouring lines tested together: scatter averages out over them, a departure does not."""

CHANCE_OF_A_DEPARTURE = 0.01
"""Probability below which a window of lines departs from the model."""


def departure(response: FrequencyResponse, model: Callable[[np.ndarray], np.ndarray]) -> Departure:
    """Find where a response leaves `model`, a function of frequencies [Hz], at its low end.

    In windows of neighbouring lines in the lower half, the mean of the ratio of response to model is tested against 1
    (F-test). The scale of the test comes from the upper half, where the model is taken to hold as well as it can. The
    departure ends with the highest window that differs. Raises InputError for fewer than 36 lines.
    """
    frequency = response.frequency
    if len(frequency) < 4 * LINES_OF_A_WINDOW:
        least = f"at least {4 * LINES_OF_A_WINDOW} lines"
        raise InputError("response", f"{len(frequency)} lines", least, "a multisine of 100 lines")
    ratio = response.response / model(frequency)
    weight = 2 * np.abs(response.response) ** 2 / response.scatter() ** 2
    half, ones = len(frequency) // 2, np.ones(LINES_OF_A_WINDOW)
    pulls = np.abs(np.convolve(weight * (ratio - 1), ones, "valid")) ** 2 / np.convolve(weight, ones, "valid") / 2
    scale = max(float(np.mean(pulls[half:])), 1.0)
    limit = scale * stats.f.ppf(1 - CHANCE_OF_A_DEPARTURE, 2, max(np.median(response.degrees), 2.0))
    off = np.flatnonzero(pulls[:half] > limit)
    name, method = "departure frequency", f"mean over {LINES_OF_A_WINDOW} lines, against the linear model"
    if not off.size:
        reason = "the response follows the model down to its lowest line"
        onset = Estimate.unknown(name, "Hz", method, reason, 0.0, float(frequency[0]))
        return Departure(onset, frequency, np.abs(ratio), *_differ(response, slice(None)))
    last = int(off[-1]) + LINES_OF_A_WINDOW - 1
    places = last - LINES_OF_A_WINDOW // 2, last - LINES_OF_A_WINDOW + 1, last
    value, low, high = (float(frequency[place]) for place in places)
    onset = Estimate(name, "Hz", value, low, high, method)
    return Departure(onset, frequency, np.abs(ratio), *_differ(response, slice(0, last + 1)))


def _differ(response: FrequencyResponse, part: slice) -> tuple[bool | None, float]:
    """Tell whether distortion exceeds noise on the spectral lines `part`, and by which ratio.

    The ratio is that of noise with distortion to noise alone. The first result is None, and the ratio NaN, if the
    distortion is not known.
    """
    noise, distortion = response.noise[part], response.distortion[part]
    if not np.all(np.isfinite(distortion)) or not np.all(noise > 0):
        return None, np.nan
    ratio = np.median((noise**2 + distortion**2) / noise**2)
    degrees = float(np.median(response.degrees))
    return bool(ratio > stats.f.ppf(1 - CHANCE_OF_A_DEPARTURE, degrees, 10 * degrees)), float(np.sqrt(ratio))


FrequencyRange = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Bench:
    """Results from the frequency responses of one machine.

    `driven` and `other` are the responses from force to position of the driven mass and, if measured, of the other
    mass. Mass lines, modes and the two-mass model are fitted within `band` [Hz]. At low frequency, `departs` says where
    friction bends the response off the mass line.

    `aside` has, for every log, the relative errors with which the model of another log predicts its outputs. `warnings`
    say what was not found, and why.
    """

    logs: tuple[Log, ...]
    driven: FrequencyResponse
    other: FrequencyResponse | None
    band: FrequencyRange
    lines: tuple[StraightLine, ...]
    modes: Modes | None
    two_masses: TwoMass | None
    seen: Visible | None
    departs: Departure | None
    aside: tuple[tuple[str, tuple[float, ...]], ...]
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class Realisations:
    """Logs of one experiment, each a realisation of its excitation."""

    logs: Sequence[Log]

    @cached_property
    def records(self) -> dict[str, list[ResponseRecord]]:
        """Return a record for each log, by output: the driven mass, and the other mass if measured in all.

        Returns {} without logs.
        """
        outputs = ["position", "cart_position"][: 1 + all("cart_position" in log for log in self.logs)]
        return {output: [_record(log, output) for log in self.logs] for output in outputs if self.logs}

    def responses(self, which: slice = slice(None)) -> list[FrequencyResponse]:
        """Estimate the response of each output from the logs `which`."""
        first = self.logs[which][0]
        return [_response(records[which], first, output) for output, records in self.records.items()]

    def single(self, number: int, band: FrequencyRange) -> TwoMass:
        """Fit the two-mass model to one log, by its number, within a band [Hz]."""
        driven, *other = self.responses(slice(number, number + 1))
        return fit_two_mass(driven, other[0] if other else None, band)


FREQUENCY_ABOVE_FRICTION = 1 / 7
"""Frequency below which friction may distort a response, relative to its highest measured frequency."""


def analyse(
    logs: Sequence[Log],
    band: FrequencyRange | None = None,
    measured: MeasuredResponse | None = None,
) -> Bench:
    """Analyse a frequency response, measured or estimated from logs of one experiment.

    `measured` is a response from another instrument. `band` [Hz] is the band of the models (default: above the effect
    of friction). Raises InputError if no response can be estimated.
    """
    runs = Realisations(logs)
    positions = runs.records.get("position", [])
    if measured is not None:
        driven, other = as_measured(measured), None
    else:
        driven, other = _clear(runs.responses())
    warnings = [text for record in positions if record.reference is None for text in feedback(record)]
    lowest, highest = float(driven.frequency[0]), float(driven.frequency[-1])
    first = band or (max(lowest, highest * FREQUENCY_ABOVE_FRICTION), _top(driven))
    model = _attempt(warnings, "two masses", fit_two_mass, driven, other, first)
    if model and band is None and _below(model, first):
        model = _attempt([], "two masses", fit_two_mass, driven, other, None) or model
    departs = _attempt(warnings, "departure", departure, driven, model.predict) if model else None
    used = band or _above(driven, departs)
    if model and len(logs) > 1:
        model = _attempt(warnings, "two masses", _of_all, runs, driven, other, used)
    if model and band is None and other is None and _below(model, used):
        low = model["antiresonance frequency"].value
        seen = "no antiresonance in" if np.isnan(low) else f"an antiresonance at {low:.3g} Hz, below"
        warnings.append(f"no two masses: {seen} the band of the model, {used[0]:.3g} to {used[1]:.3g} Hz")
        model = None
    upper = driven.between(*used)
    if model and not needs_two(model, driven, other):
        warnings.append("no two masses: one mass, with viscous friction and a spring to ground, explains the response")
        model = None
    modes = _attempt(warnings, "modes", fit_modes, upper)
    warnings += model.warnings if model else ()
    return Bench(
        logs=tuple(logs),
        driven=driven,
        other=other,
        band=used,
        lines=_attempt(warnings, "mass lines", mass_lines, upper) or (),
        modes=modes,
        two_masses=model,
        seen=_attempt(warnings, "limit cases", visible, upper, modes),
        departs=departs,
        aside=_left_out(warnings, runs, used),
        warnings=tuple(dict.fromkeys([*driven.warnings, *warnings])),
    )


def as_measured(measured: MeasuredResponse) -> FrequencyResponse:
    """Convert a response from another instrument; scatter between lines gives its accuracy."""
    output, _, unit = measured.unit.partition("/")
    return FrequencyResponse.undivided(
        measured.frequency,
        measured.response,
        np.zeros(len(measured.frequency)),
        2.0,
        kind="measured",
        channels=Channels("force", unit or "1", "position", output or "1"),
        coherence=measured.coherence,
        warnings=("the file gives no deviations: the scatter between neighbouring lines stands for them",),
    )


def predicted(bench: Bench, log: Log) -> tuple[float, ...]:
    """Return the relative errors of the two-mass model in predicting another log's outputs.

    The errors are taken over the band of the model. Raises InputError if there is no model.
    """
    if bench.two_masses is None:
        raise InputError("--predict", "no two-mass model", "a response with an antiresonance and a resonance")
    return _errors(bench.two_masses, log, bench.band, bench.other is not None)


def _attempt(warnings: list[str], label: str, function, *arguments):
    """Return the result of a `function` with these arguments; None if it raises InputError.

    The reason is then added to the warnings, after the `label` of what was sought.
    """
    try:
        return function(*arguments)
    except InputError as error:
        warnings.append(f"no {label}: {error.actual}; expected {error.expected}")
        return None


def _record(log: Log, output: str) -> ResponseRecord:
    """Return a log as a record of force and an output."""
    return from_log(log, "force", output, external(log))[0]


def _response(records: Sequence[ResponseRecord], log: Log, output: str) -> FrequencyResponse:
    """Estimate a response by averages over periods, or by local polynomials if nothing repeats.

    `records` are the realisations; input and output are named as the log's channels.
    """
    channels = from_log(log, "force", output)[1]
    try:
        find_periods(records[0].driving)
    except InputError:
        if len(records) > 1:
            raise
        return local_polynomial(records[0], channels)
    return multisine(records, channels)


def _clear(responses: Sequence[FrequencyResponse]) -> tuple[FrequencyResponse, FrequencyResponse | None]:
    """Keep the spectral lines on which the response of any output stands out of the noise.

    The responses are those of the driven mass and, if measured, of the other mass; the second result is None without
    the other. Raises InputError for an output that stands out on no line.
    """
    good = np.unique(np.concatenate([response.usable().frequency for response in responses]))
    usable = [response.at(np.isin(response.frequency, good)) for response in responses]
    return usable[0], usable[1] if len(usable) > 1 else None


def _below(model: TwoMass, band: FrequencyRange) -> bool:
    """Tell whether a two-mass model has no antiresonance, or has it below a band [Hz].

    Below the band, an antiresonance may be an effect that the model leaves out, such as bristles.
    """
    return not model["antiresonance frequency"].value >= band[0]


def _above(driven: FrequencyResponse, departs: Departure | None) -> FrequencyRange:
    """Return the band [Hz] above the frequencies at which friction distorts the response.

    If none were found, the band begins with the first line.
    """
    low = departs.frequency.high if departs is not None and departs.frequency.determined else 0.0
    return max(float(driven.frequency[0]), low), _top(driven)


def _top(driven: FrequencyResponse) -> float:
    """Return the upper end of a band [Hz] that includes the highest frequency of the response."""
    return float(driven.frequency[-1]) * (1 + 1e-9)


def _of_all(
    runs: Realisations, driven: FrequencyResponse, other: FrequencyResponse | None, band: FrequencyRange
) -> TwoMass:
    """Fit the two-mass model to all realisations, and widen intervals to their scatter.

    The scatter is that of fits to single realisations.
    """
    return widened(fit_two_mass(driven, other, band), [runs.single(i, band) for i in range(len(runs.logs))])


def _left_out(
    warnings: list[str], runs: Realisations, band: FrequencyRange
) -> tuple[tuple[str, tuple[float, ...]], ...]:
    """Return, for each log, the relative errors with which the model of another log predicts it.

    The result is empty for a single log. A log is left out if no model fits the other one; `warnings` get the reason.
    """
    rows = []
    for i, log in enumerate(runs.logs if len(runs.logs) > 1 else ()):
        model = _attempt(warnings, "two masses", runs.single, (i + 1) % len(runs.logs), band)
        if model is not None:
            rows.append((log.name, _errors(model, log, band, len(runs.records) > 1)))
    return tuple(rows)


def _errors(model: TwoMass, log: Log, band: FrequencyRange, both: bool) -> tuple[float, ...]:
    """Return the relative prediction errors of the driven mass and, with `both`, of the other."""
    return tuple(
        relative_error(lambda f, c=output == "position": model.predict(f, c), _record(log, output), band)
        for output in ("position", "cart_position")[: 1 + both]
    )


@dataclass(frozen=True)
class Visible:
    """Features of a response of a stage on a cart.

    Fields are the straight lines by rising frequency, modes (None: too few lines, or no fit), the `case` of the cart
    ("stuck", "sliding", or "" if undecided), and a description in words.
    """

    case: str
    lines: tuple[StraightLine, ...]
    modes: Modes | None
    words: tuple[str, ...]


def visible(response: FrequencyResponse, modes: Modes | None = None) -> Visible:
    """Find the lines and modes of a force-to-position response.

    `modes` are fitted if None.
    """
    sign = _sign(response)
    lines = [line for slope in KINDS for line in straight_lines(response, slope, sign)]
    ordered = tuple(sorted(lines, key=lambda line: line.low))
    if modes is None and len(response.frequency) >= 12:
        modes = fit_modes(response)
    pairs = _resonances(modes)
    case = _case(ordered, pairs)
    resonances = (f"{name} at {value:.4g} Hz" for name, value in pairs.items())
    return Visible(case, ordered, modes, (*map(_words, ordered), *resonances, _verdict(case, pairs)))


def _sign(response: FrequencyResponse) -> float | None:
    """Return the sign of the widest straight line of a response; None if it has no such line.

    Stiffness, damping and mass lines count. The sign is -1 if the output opposes the input.
    """
    lines = [line for slope in KINDS for line in straight_lines(response, slope, None, 1)]
    return max(lines, key=lambda line: line.octaves).sign if lines else None


def _resonances(modes: Modes | None) -> Mapping[str, float]:
    """Return the frequencies [Hz] of resonances and antiresonances by name, ascending.

    Returns {} if there are no modes.
    """
    if modes is None:
        return {}
    frequencies = sorted((one for one in modes.estimates if one.unit == "Hz"), key=lambda one: one.value)
    return {one.name.removesuffix(" frequency"): one.value for one in frequencies}


def _case(lines: tuple[StraightLine, ...], pairs: Mapping[str, float]) -> str:
    """Tell by the lowest straight line whether the cart is "stuck" or "sliding".

    A stiffness line means a stuck cart, a mass or damping line a sliding cart. A line above the first antiresonance, or
    the first resonance if there is none, says nothing about the cart. Without another line the result is "".
    """
    kind = "antiresonance" if any(name.startswith("antiresonance") for name in pairs) else "resonance"
    first = min((value for name, value in pairs.items() if name.startswith(kind)), default=np.inf)
    below = [line for line in lines if line.low < first]
    if not below:
        return ""
    return "stuck" if below[0].kind == "stiffness line" else "sliding"


def _words(line: StraightLine) -> str:
    """Return in words which straight line it is, with its value and its range of frequency."""
    value = line.value
    text = f"{value.value:.4g} {value.unit} ({value.low:.4g} to {value.high:.4g})"
    return f"{line.kind} from {line.low:.3g} to {line.high:.3g} Hz: {text}"


def _verdict(case: str, pairs: Mapping[str, float]) -> str:
    """Return in words whether the cart is stuck or sliding, and with which modes of the joint."""
    kinds = [name.split()[0] for name in pairs]
    pair = any(a == "antiresonance" and b == "resonance" for a, b in pairwise(kinds))
    if case == "sliding":
        return "cart sliding: " + ("free joint, antiresonance and resonance" if pair else "no joint mode is seen")
    if case == "stuck":
        spring = "friction or joint as a spring, then a mode" if "resonance" in kinds else "spring alone"
        return f"cart stuck: {spring}"
    return "no straight line below the modes: the cart may be stuck or sliding"
