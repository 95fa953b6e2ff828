"""Define the frequency response of a record: complex values on lines, with their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import stats

from friso.errors import InputError
from friso.identification.response.settings import settings


@dataclass(frozen=True)
class Channels:
    """Names and units of input and output."""

    input: str = "force"
    input_unit: str = "N"
    output: str = "position"
    output_unit: str = "m"


@dataclass(frozen=True)
class ResponseBand:
    """Limits of the 95 % intervals of magnitude [output per input unit] and phase [rad], (lines,)."""

    magnitude_low: np.ndarray
    magnitude_high: np.ndarray
    phase_low: np.ndarray
    phase_high: np.ndarray


@dataclass(frozen=True, kw_only=True)
class FrequencyResponse:
    """A response at the spectral lines `frequency` [Hz]; all arrays have the shape (lines,).

    `response` is complex [output unit per input unit]. `deviation` is its total standard deviation, sqrt(E|error|^2).
    Its parts are `noise` (differs from period to period) and `distortion` (differs from realisation to realisation):
    deviation^2 = noise^2 + distortion^2 if both are known, else NaN.

    `degrees` is the number of real degrees of freedom behind the deviation. `coherence` is between input and output
    (None: not known). `kind` is "multisine", "local polynomial" or "measured". `sample_time` [s] is the
    record's (None: not known).
    """

    frequency: np.ndarray
    response: np.ndarray
    deviation: np.ndarray
    noise: np.ndarray
    distortion: np.ndarray
    degrees: np.ndarray
    kind: str
    channels: Channels = Channels()
    coherence: np.ndarray | None = None
    warnings: tuple[str, ...] = ()
    sample_time: float | None = None

    @classmethod
    def undivided(
        cls, frequency: np.ndarray, response: np.ndarray, deviation: np.ndarray, degrees: float, **further: Any
    ) -> FrequencyResponse:
        """Make a response whose deviation is not divided into noise and distortion.

        Frequencies [Hz] and all other arrays have the shape (lines,). All lines have equally many `degrees` of freedom.
        `further` has the other fields.
        """
        unknown = np.full(len(frequency), np.nan)
        freedom = np.full(len(frequency), degrees)
        lines = {"frequency": frequency, "response": response, "deviation": deviation, "degrees": freedom}
        return cls(**lines, noise=unknown, distortion=unknown, **further)

    def band(self) -> ResponseBand:
        """Return the 95 % intervals of magnitude and phase.

        Half of the variance is taken in the direction of the complex response, half across it.
        """
        half = stats.t.ppf(0.975, self.degrees) * self.deviation / np.sqrt(2)
        size, phase = np.abs(self.response), np.unwrap(np.angle(self.response))
        with np.errstate(divide="ignore", invalid="ignore"):
            turn = np.where(half < size, np.arcsin(np.minimum(half / size, 1.0)), np.pi)
        return ResponseBand(np.maximum(size - half, 0.0), size + half, phase - turn, phase + turn)

    def accelerations(self) -> FrequencyResponse:
        """Return the response of the acceleration in place of the position: times (i omega)^2."""
        factor = (2 * np.pi * self.frequency) ** 2
        channels = replace(self.channels, output="acceleration", output_unit=f"{self.channels.output_unit}/s^2")
        scaled = {name: factor * getattr(self, name) for name in ("deviation", "noise", "distortion")}
        return replace(self, response=-factor * self.response, channels=channels, **scaled)

    def at(self, chosen: np.ndarray) -> FrequencyResponse:
        """Return the response at spectral lines that a mask or their numbers choose."""
        names = ("frequency", "response", "deviation", "noise", "distortion", "degrees")
        lines = {name: getattr(self, name)[chosen] for name in names}
        return replace(self, coherence=None if self.coherence is None else self.coherence[chosen], **lines)

    def between(self, low: float, high: float) -> FrequencyResponse:
        """Return the response at spectral lines from `low` to `high` [Hz], both included.

        Raises InputError where there are none.
        """
        inside = (self.frequency >= low) & (self.frequency <= high)
        if not inside.any():
            text = f"{low:g} to {high:g} Hz"
            held = f"{self.frequency.min():g} to {self.frequency.max():g} Hz" if self.frequency.size else "no lines"
            raise InputError("band", text, f"a band that holds lines of the response, which has {held}", "3 to 20 Hz")
        return self.at(inside)

    def usable(self, ratio: float = 3.0) -> FrequencyResponse:
        """Return the response at spectral lines that are clear of noise: `ratio` deviations large.

        Their coherence must also suffice, if it is known. Warnings list the lines left out. Raises InputError if none
        is left, because the excitation is too weak.
        """
        enough = np.abs(self.response) >= ratio * self.deviation
        if self.coherence is not None:
            enough &= self.coherence >= settings.coherence_of_a_line
        if not enough.any():
            best = np.max(np.abs(self.response) / np.maximum(self.deviation, np.finfo(float).tiny), initial=0.0)
            text = f"no line stands out of the noise (at best {best:.2g} standard deviations)"
            if self.coherence is not None and self.coherence.size:
                text += f", coherence at most {np.max(self.coherence):.2g}"
            coherence = f"a coherence of {settings.coherence_of_a_line:g}"
            expected = f"a response of {ratio:g} deviations and {coherence} on some line"
            raise InputError("excitation", text, expected, "a larger force, or a longer record")
        if enough.all():
            return self
        left_out = self.frequency[~enough]
        band = f"{left_out.min():.3g} to {left_out.max():.3g} Hz"
        warning = f"{left_out.size} of {enough.size} lines left out, too weakly excited ({band})"
        return replace(self.at(enough), warnings=(*self.warnings, warning))

    def scatter(self) -> np.ndarray:
        """Return the deviations (lines,), raised to the scatter between neighbouring lines.

        Nonlinear distortion makes the lines of one realisation scatter beyond their noise; a smooth system cannot.
        """
        size = np.abs(self.response)
        if len(size) < 3 or not np.all(size > 0):
            return self.deviation
        second = np.abs(np.diff(np.log(size), 2)) / np.sqrt(6)
        width = min(settings.lines_of_a_scatter, len(second))
        medians = np.median(np.lib.stride_tricks.sliding_window_view(second, width), axis=1)
        places = np.arange(len(size)) - 1 - (width - 1) / 2
        rough = 1.4826 * np.interp(places, np.arange(len(medians)), medians)  # of normal deviations
        return np.maximum(self.deviation, np.sqrt(2) * rough * size)
