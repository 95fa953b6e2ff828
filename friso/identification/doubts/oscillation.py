"""Doubt: the residual oscillates at one frequency, by a mode in the band or by cogging at constant speed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.signal import welch

from friso.identification.doubt import Doubt, RaisedDoubt, RecordCase
from friso.identification.settings import doubt_settings
from friso.quantities import percent


def find(case: RecordCase) -> Iterator[RaisedDoubt]:
    """Look for a spectral peak that holds most of the residual's power.

    A structural mode oscillates at one frequency, and so does a force that repeats along the way at constant speed.
    """
    inverse = case.inverse
    left = inverse.measured - inverse.fitted
    step = float(np.median(np.diff(inverse.time)))
    rates, power = welch(left, 1 / step, nperseg=min(len(left), doubt_settings.samples_of_a_spectrum))
    peak = int(np.argmax(power))
    share = power[max(peak - 1, 0) : peak + 2].sum() / power.sum() if power.sum() > 0 else 0.0
    if share < doubt_settings.power_share_of_an_oscillation or peak == 0:
        return
    words = (
        f"{percent(share)} of the power of the residual is near {rates[peak]:.3g} Hz: a mode in the band, or a force "
        "that repeats along the way, such as cogging"
    )
    yield RaisedDoubt(words=words, size=float(share))


DOUBT = Doubt(
    "otherwise",
    find,
    "the spectrum of the residual",
    "reported",
    "a frequency response, or passes at two speeds: cogging moves with the speed, a mode does not",
    after=("perhaps-feedforward",),
)
