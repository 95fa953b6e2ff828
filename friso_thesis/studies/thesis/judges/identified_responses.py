"""Judge the responses by which the thesis identifies its rig (Fig. 17 and 18).

The same experiments are simulated. What the simulation assumes (masses, stiffness, friction of Table 2) must come out
as entered. So the judges ask whether the experiments show it, and what else they would have to show.
"""

from __future__ import annotations

import numpy as np

from friso.quantities import percent
from friso_thesis.studies.thesis.claims import Evidence, Finding, Part, judges
from friso_thesis.studies.thesis.experiments import BUILT, COULOMB, FORCE, FREQUENCIES, LINE, RANGE, LockedLine
from friso_thesis.studies.thesis.judges.rig_loops import on_the_rig, weaker_motor
from friso_thesis.studies.thesis.linear import PLANT
from friso_thesis.studies.thesis.reading import reading

MEASURED, WEIGHED = (2.5, 0.75), (1.7, 0.5)
"""Masses [kg] of the whole rig and of its stage: measured by mass lines (Fig. 17, 18), and weighed (Sec. 4.2.1)."""

CONSTANTS = (MEASURED[0] / WEIGHED[0], MEASURED[1] / WEIGHED[1])
"""Ratios by which the motor constant would have to be underestimated to explain the measured masses."""

_LINE_TO, _NOISY = 200.0, (10.0, 80.0)
"""Upper end of the visible mass line, and range in which single identifications are noisy [Hz] (Sec. 4.2.1)."""

FIRST, _PARASITIC = 11.0, 300.0
"""Modes of the free joint [Hz] (Sec. 4.2.1)."""


@judges("F17", figure="17", needs=(LINE, BUILT))
def mass_line_of_the_locked_rig(evidence: Evidence) -> Finding:
    """Judge the locked rig's mass line and its scatter over places with different friction."""
    flat = evidence.rig.flat()
    line = judged_line(evidence.experiments.locked_line, flat["masses.cart"] + flat["masses.stage"])
    return Finding((*line.parts, *on_the_rig(evidence, lambda built: weaker_motor(built, 0, MEASURED[0], WEIGHED[0]))))


def judged_line(line: LockedLine, moved: float) -> Finding:
    """Judge how far up the locked rig follows a mass line, which mass it shows, and its scatter.

    `line` has the simulated responses at several places; `moved` [kg] is the mass that moves.
    """
    words = reading()
    rates, magnitude, scatter = np.array(FREQUENCIES), line.magnitude, line.scatter
    mean = np.nanmean(magnitude, axis=0)
    about_one = (mean > 1 / words.about) & (mean < words.about)
    end = float(max(rates[: len(about_one) if about_one.all() else int(about_one.argmin())], default=0.0))
    inside = (rates >= _NOISY[0]) & (rates <= _NOISY[1])
    mass = moved / np.nanmedian(magnitude[:, inside], axis=1)
    worst, above = float(rates[np.nanargmax(scatter)]), float(np.nanmax(scatter[rates >= 1.5 * _NOISY[1]]))
    weighed, seen = WEIGHED[0], MEASURED[0]
    return Finding(
        (
            Part(
                f"the response stays on the mass line (within a factor of {words.about:g}) up to about "
                f"{_LINE_TO:g} Hz (at "
                f"least {_LINE_TO / words.about:.3g} Hz)",
                end >= _LINE_TO / words.about,
                f"up to {end:.3g} Hz, of those computed",
            ),
            Part(
                f"the mass read off it is nearer {seen:g} than the {weighed:g} kg weighed (by their ratios)",
                bool(np.nanmedian(mass) > (seen * weighed) ** 0.5),
                f"{mass.min():.3g} to {mass.max():.3g} kg at {len(mass)} places",
                beyond="Simulation cannot decide this: friction hardly moves the line; cables or the motor "
                f"constant (Sec. 4.2.1), not in the model, may, the latter by the factor {CONSTANTS[0]:.2f}; Fig. 18 "
                f"asks for {CONSTANTS[1]:.2f}.",
            ),
            Part(
                f"identifications at different places differ most between {_NOISY[0]:g} and {_NOISY[1]:g} Hz, by more "
                f"than {words.about:g} times as much as from {1.5 * _NOISY[1]:g} Hz",
                bool(_NOISY[0] <= worst <= _NOISY[1] and np.nanmax(scatter) > words.about * above),
                f"the phase scatters most at {worst:.3g} Hz, by {np.degrees(np.nanmax(scatter)):.2g} degrees, and by "
                f"{np.degrees(above):.2g} above. Assumed, as the thesis states neither: sines of {FORCE:g} N; places "
                f"with static friction spread evenly over the {RANGE[0]:g} to {RANGE[1]:g} N of Fig. 20, "
                f"{percent(COULOMB)} of it as Coulomb friction",
            ),
        )
    )


@judges("F18", figure="18", needs=(PLANT, BUILT))
def response_of_the_free_joint(evidence: Evidence) -> Finding:
    """Judge whether modes and mass line with the joint free are as the thesis measured them.

    A further question is whether one error of the motor constant explains both masses that the thesis identified.
    """
    words = reading()
    plants = evidence.analysis.plants
    stuck, sliding = plants["stuck"], plants["sliding"]
    reads = sorted((stuck.mass, sliding.mass))
    seen, weighed = MEASURED[1], WEIGHED[1]
    factor = seen / float(np.mean(reads))
    both = "would explain" if abs(factor / CONSTANTS[0] - 1) <= words.close else "does not explain"
    return Finding(
        (
            Part(
                f"the first mode is about {FIRST:g} Hz (within {percent(words.close)}) with the cart stuck",
                bool(abs(stuck.first / FIRST - 1) <= words.close),
                f"{stuck.first:.3g} Hz stuck, {sliding.first:.3g} Hz sliding: the force hardly moved the cart",
            ),
            Part(
                f"a parasitic mode is about {_PARASITIC:g} Hz (within {percent(words.close)})",
                bool(abs(stuck.parasitic / _PARASITIC - 1) <= words.close),
                f"{stuck.parasitic:.4g} Hz (entered in the simulation, from this figure)",
                self_test=True,
            ),
            Part(
                f"the mass line between them is nearer {seen:g} than the {weighed:g} kg weighed (by their ratios)",
                bool(reads[0] > (seen * weighed) ** 0.5),
                f"{reads[0]:.3g} to {reads[1]:.3g} kg",
                beyond=f"Simulation cannot decide this: the line lies by a factor of {factor:.2f} off, in Fig. 17 "
                f"by {CONSTANTS[0]:.2f}; one error of the motor constant, which is not in the model, {both} both (to "
                f"{percent(words.close)}), and the first mode does not depend on it.",
            ),
            *on_the_rig(evidence, lambda built: weaker_motor(built, 1, MEASURED[1], WEIGHED[1])),
        )
    )
