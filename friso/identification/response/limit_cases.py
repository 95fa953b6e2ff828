"""The limit cases of a stage (thesis, Table 1 and Fig. 7) in a measured response, in the words of `friso.frequency`.

A cart that is "stuck" makes friction a spring: a stiffness line at low frequency, and with a free joint the mode of the
stage on it. A cart that is "sliding" shows the mass line of cart and stage, and with a free joint an antiresonance and
a resonance, above which the mass line of the stage alone follows. A touched limiter is recognised by its frequencies.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from friso.identification.response.mass_line import KINDS, StraightLine, straight_lines
from friso.identification.response.modes import Modes, fit_modes
from friso.identification.response.response import FrequencyResponse


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
