"""Detect closed loops in records, and find the crossovers of a measured open loop."""

from __future__ import annotations

import numpy as np
from scipy import stats

from friso.errors import InputError
from friso.identification.estimate import Estimate
from friso.identification.response.period import find_periods
from friso.identification.response.records import ResponseRecord, drift
from friso.identification.response.response import FrequencyResponse
from friso.identification.response.settings import settings
from friso.quantities import percent


def feedback(record: ResponseRecord, direct: bool = False) -> tuple[str, ...]:
    """Return signs that a controller feeds the output back to the input; () for none.

    Without a loop the output's past cannot help to predict the input beyond the input's own past (Granger 1969,
    doi:10.2307/1912791; for feedback: Caines, Chan 1975, doi:10.1109/TAC.1975.1101008). The periodic part of the input
    is removed; an input that repeats exactly contains no reaction. Slow or weak loops stay undetected.

    The present sample of the output counts as past, because a position cannot react to a force within one sample.
    `direct` is true for an output that does, such as an acceleration.
    """
    record = record.checked(settings.samples_of_a_feedback_test)
    driven, answer = _surprising(record)
    if driven is None or answer is None:
        return ()
    chance, share = _foretold(driven, answer, direct)
    if chance > settings.chance_of_feedback or share < settings.share_of_surprise:
        return ()
    finding = f"the output predicts {percent(share)} of the innovation of the input (chance {chance:.1g})"
    return (f"{finding}: closed loop, a direct estimate is biased; give the force injected, or a reference that moves",)


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
    if np.std(parts[0]) <= settings.difference_of_played_periods * np.std(record.input):
        return None, None
    return parts[0], parts[1]


def _foretold(driven: np.ndarray, answer: np.ndarray, direct: bool) -> tuple[float, float]:
    """Test whether the past of the output helps to predict the input.

    With `direct`, the present sample of the output is no past. Returns the probability (F-test) that the output's past
    does not help, and the fraction of the input's unpredicted part that it explains.
    """
    own, others, first = settings.past_of_the_input, settings.past_of_the_output, int(direct)
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
