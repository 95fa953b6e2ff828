"""Try changes that would make the model match measurements: masses, a softer contact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.equations.controllers.van_dijk import CROSSOVER, TUNED_MASS
from friso.frequency.margins import Margins, margins
from friso.frequency.members import in_series, limit_cases
from friso.stage import Stage
from friso_thesis.studies.thesis.studies import LOCKED

IDENTIFIED: Mapping[str, Any] = {"masses.stage": "0.75 kg", TUNED_MASS: "2.5 kg"}
"""The masses that the thesis identified (Sec. 4.2.1)."""

FURTHER = 600.0
"""Further crossing of 0 dB that the thesis measured [Hz] (Sec. 4.2.4)."""

AT_HIGHEST: Mapping[str, Any] = {**LOCKED, CROSSOVER: "48 Hz"}
"""Setting at which the thesis measured a further crossing."""

LITTLE = "1 N*s/m"
"""Limiter damping of a contact with hardly any loss."""


@dataclass(frozen=True)
class Contact:
    """A contact of cart and stage so soft that its mode lies at a further crossing of 0 dB.

    The thesis measured this crossing with the joint locked. The contact has a `stiffness` [N/m]. `margins` are those of
    the loop with the cart sliding, tuned to the highest crossover, with the rig's limiter damping; `undamped` are those
    with little damping.
    """

    stiffness: float
    margins: Margins
    undamped: Margins


def identified_loop(stage: Stage) -> Margins:
    """Return the margins of the sliding cart, joint free, with the identified masses."""
    return _sliding(stage.replace(dict(IDENTIFIED)))


def soft_contact(stage: Stage) -> Contact:
    """Compute a contact of cart and stage whose mode lies at the further 0 dB crossing measured.

    The part of the stage that its parasitic mode carries hardly takes part in the contact's mode.
    """
    flat = stage.flat()
    reduced = in_series(flat["masses.cart"], flat["masses.stage"] - flat["parasitic.mass"])
    stiffness = float((2 * np.pi * FURTHER) ** 2 * reduced)
    soft = stage.replace({**AT_HIGHEST, "joint.limiter_stiffness": f"{stiffness!r} N/m"})
    return Contact(stiffness, _sliding(soft), _sliding(soft.replace({"joint.limiter_damping": LITTLE})))


def _sliding(stage: Stage) -> Margins:
    flat = stage.flat()
    return margins(flat, limit_cases(flat)["sliding"])
