"""Compute the rig's loops at the thesis's crossovers, and how fast it may be controlled.

This is done with and without its drive. Changes are tried that would make the model match measurements: masses, a
softer contact.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from friso.equations.bandwidth import faster
from friso.equations.controllers.pid import CROSSOVER, TUNED_MASS
from friso.frequency.bode import HIGHEST_CROSSOVER, range_end, ranges_below, searched_crossovers, stable_crossovers
from friso.frequency.margins import (
    MARGIN_DENSITY,
    Margins,
    controller_response,
    frequencies,
    loops,
    margins,
    plant_poles,
    plants,
    with_resonances,
)
from friso.frequency.system import DriveTiming, Members, in_series, limit_cases
from friso.stage import Stage
from friso_thesis.studies.rig.experiments.frf import CROSSOVER_SETTINGS as MEASURED_SETTINGS
from friso_thesis.studies.thesis.studies import LOCKED

IDENTIFIED: Mapping[str, Any] = {"masses.stage": "0.75 kg", TUNED_MASS: "2.5 kg"}
"""The masses that the thesis identified (Sec. 4.2.1)."""

FURTHER_CROSSING = 600.0
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
    stiffness = float((2 * np.pi * FURTHER_CROSSING) ** 2 * reduced)
    soft = stage.replace({**AT_HIGHEST, "joint.limiter_stiffness": f"{stiffness!r} N/m"})
    return Contact(stiffness, _sliding(soft), _sliding(soft.replace({"joint.limiter_damping": LITTLE})))


def _sliding(stage: Stage) -> Margins:
    flat = stage.flat()
    return margins(flat, limit_cases(flat)["sliding"])


SETTINGS = tuple(8.0 * factor for factor in MEASURED_SETTINGS)
"""Crossovers [Hz] of Fig. 22, equal for the model and for the measured rig, which are drawn together."""

HIGHEST_CROSSOVERS = (48.0, 60.0)
"""Crossovers [Hz] that the thesis calls the highest, of the rig (Sec. 4.2.4) and of the simulation (Sec. 3.4.2)."""

SAMPLED = "50 us"
"""Sample time of the rig's controller (Sec. 3.5)."""

LOOP_DELAYS = (0.0, 50e-6, 100e-6, 150e-6, 200e-6, 500e-6, 1e-3)
"""Delays [s] of drive, encoder and computation, besides the hold. The thesis states none, so they range from zero over
a few samples to the delay of a fieldbus."""

CURVE_RANGE = (1.0, 3e3)
"""Frequencies [Hz] over which the loops are drawn."""

CURVE_POINTS = 600
"""Number of frequencies of a curve; more lie around resonances."""

LOWEST_CROSSOVER, CROSSOVER_STEPS = 1.0, 61
"""Lowest crossover [Hz] and number of crossovers in the search for the ends of a range."""


@dataclass(frozen=True)
class CrossoverLoops:
    """The loops of a rig with its joint free or locked, tuned to each crossover [Hz].

    - `margins`: by crossover and limit case.
    - `curves`: over `omega` [rad/s], the loop of the sliding cart by crossover, complex, its limiter free if it can be.
    - `single`: highest crossover [Hz] up to which the loop of the sliding stage as one mass (locked or with a touched
      limiter) crosses 0 dB only once.
    - `unsampled`: highest crossover up to which it is stable in all limit cases, in continuous time without delay.
    - `sampled`: the same limit at the rig's sample time, by delay [s]. None beyond 10 kHz, half the sampling frequency,
      and 0 if there is none.
    - `delay_at`: delay [s], at that sample time, that takes a crossover to the edge of stability; NaN if it is unstable
      anyway.
    """

    margins: Mapping[float, Mapping[str, Margins]]
    omega: np.ndarray
    curves: Mapping[float, np.ndarray]
    single: float | None
    unsampled: float | None
    sampled: Mapping[float, float | None]
    delay_at: Mapping[float, float]


def loops_of(stage: Stage, settings: tuple[float, ...]) -> CrossoverLoops:
    """Return the loops of a stage, tuned to the crossovers `settings` [Hz]."""
    flat = stage.flat()
    tuned = {f: _tuned(flat, f) for f in settings}
    resonances = plant_poles(flat, Members.joined(limit_cases(flat).values()))
    omega = with_resonances(np.geomspace(*CURVE_RANGE, CURVE_POINTS) * 2 * np.pi, [resonances])
    moving = limit_cases(flat)["sliding"]
    drive = stage.replace({"drive.sample_time": SAMPLED}).flat()
    return CrossoverLoops(
        margins={
            f: {name: margins(keys, member) for name, member in limit_cases(keys).items()} for f, keys in tuned.items()
        },
        omega=omega,
        curves={f: loops(keys, moving, omega)[0] for f, keys in tuned.items()},
        single=_single(flat),
        unsampled=_highest(flat),
        sampled={delay: _highest({**drive, "drive.delay": delay}) for delay in LOOP_DELAYS},
        delay_at={f: _edge(_tuned(drive, f)) for f in HIGHEST_CROSSOVERS},
    )


def _tuned(flat: Mapping[str, Any], crossover: Any) -> dict[str, Any]:
    return faster(flat, crossover / flat[CROSSOVER])


def _single(flat: Mapping[str, Any]) -> float | None:
    """Return the highest crossover [Hz] up to which the sliding loop crosses 0 dB only once.

    A free joint's limiter is touched, because the controller is tuned for the whole mass. The result is None if the
    loop does so up to the end of the search, and 0 if it does at no crossover.
    """
    cases = limit_cases(flat)
    member = cases.get("sliding-touched", cases["sliding"])
    omega = frequencies(flat, member, DriveTiming.of(flat), MARGIN_DENSITY, [plant_poles(flat, member)])
    bare = plants(flat, member, omega)[0]

    def more(crossover: np.ndarray) -> np.ndarray:
        above = np.array([np.abs(bare * controller_response(_tuned(flat, f), omega)) > 1 for f in crossover])
        return (above[:, 1:] != above[:, :-1]).sum(axis=1) - 1.5

    at = np.geomspace(LOWEST_CROSSOVER, 0.999 * HIGHEST_CROSSOVER, CROSSOVER_STEPS)
    end = next((high for _, high in ranges_below(at, more)), 0.0)
    return None if end >= at[-1] else end


def _highest(flat: Mapping[str, Any]) -> float | None:
    """Return the highest crossover [Hz] up to which the loop is stable in all limit cases.

    The result is None if it is stable up to the end of the search, and 0 if it is at no crossover.
    """
    ranges = stable_crossovers(flat, Members.joined(limit_cases(flat).values()))
    end = range_end(ranges, flat[CROSSOVER]) or 0.0
    return None if end == searched_crossovers(flat)[1] else end


def _edge(flat: Mapping[str, Any]) -> float:
    """Return the least delay [s] that makes the loop unstable in some limit case."""
    return float(np.min([margins(flat, member).delay_margin for member in limit_cases(flat).values()]))
