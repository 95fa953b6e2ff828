"""Judge what the thesis identifies: in time (Fig. 19 to 21), in responses (Fig. 17, 18).

The experiments are simulated again. What the simulation assumes (masses, stiffness, friction of Table 2) must come out
as entered. So the judges ask whether the experiments show it, and what else they would have to show.
"""

from __future__ import annotations

import numpy as np

from friso.identification.estimate import Estimate
from friso.identification.readings.motion_events import static_friction
from friso.quantities import percent
from friso_thesis.studies.thesis.claims import Evidence, Finding, FindingTable, Part, judges, number_text
from friso_thesis.studies.thesis.experiments import (
    BUILT,
    COULOMB_SHARE,
    FORCE_AMPLITUDE,
    LINE,
    RESPONSE_FREQUENCIES,
    SLIPS,
    SLOW_TIME,
    SPEEDY,
    STANDING_TIME,
    STATIC_RANGE,
    STEPPED,
    ConstantSpeed,
    JointSteps,
    LockedLine,
    SlowMotion,
)
from friso_thesis.studies.thesis.judges.rig_loops import RAIL, on_the_rig, weaker_motor
from friso_thesis.studies.thesis.linear import PLANT
from friso_thesis.studies.thesis.reading import words

MEASURED_MASSES, WEIGHED_MASSES = (2.5, 0.75), (1.7, 0.5)
"""Masses [kg] of the whole rig and of its stage: measured by mass lines (Fig. 17, 18), and weighed (Sec. 4.2.1)."""

CONSTANTS = (MEASURED_MASSES[0] / WEIGHED_MASSES[0], MEASURED_MASSES[1] / WEIGHED_MASSES[1])
"""Ratios by which the motor constant would have to be underestimated to explain the measured masses."""

_LINE_TO, NOISY_RANGE = 200.0, (10.0, 80.0)
"""Upper end of the visible mass line, and range in which single identifications are noisy [Hz] (Sec. 4.2.1)."""

FIRST_MODE, PARASITIC_MODE = 11.0, 300.0
"""Modes of the free joint [Hz] (Sec. 4.2.1)."""


@judges("F17", figure="17", needs=(LINE, BUILT))
def mass_line_of_the_locked_rig(evidence: Evidence) -> Finding:
    """Judge the locked rig's mass line and its scatter over places with different friction."""
    flat = evidence.rig.flat()
    line = judged_line(evidence.experiments.locked_line, flat["masses.cart"] + flat["masses.stage"])
    return Finding.of(
        *line.parts, *on_the_rig(evidence, lambda built: weaker_motor(built, 0, MEASURED_MASSES[0], WEIGHED_MASSES[0]))
    )


def judged_line(line: LockedLine, moved: float) -> Finding:
    """Judge how far up the locked rig follows a mass line, which mass it shows, and its scatter.

    `line` has the simulated responses at several places; `moved` [kg] is the mass that moves.
    """
    rates, magnitude, scatter = np.array(RESPONSE_FREQUENCIES), line.magnitude, line.scatter
    mean = np.nanmean(magnitude, axis=0)
    about_one = (mean > 1 / words.about) & (mean < words.about)
    end = float(max(rates[: len(about_one) if about_one.all() else int(about_one.argmin())], default=0.0))
    inside = (rates >= NOISY_RANGE[0]) & (rates <= NOISY_RANGE[1])
    mass = moved / np.nanmedian(magnitude[:, inside], axis=1)
    worst, above = float(rates[np.nanargmax(scatter)]), float(np.nanmax(scatter[rates >= 1.5 * NOISY_RANGE[1]]))
    weighed, seen = WEIGHED_MASSES[0], MEASURED_MASSES[0]
    return Finding.of(
        Part(
            f"the response stays on the mass line (within a factor of {words.about:g}) up to about {_LINE_TO:g} Hz (at "
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
            f"identifications at different places differ most between {NOISY_RANGE[0]:g} and {NOISY_RANGE[1]:g} Hz, by "
            "more "
            f"than {words.about:g} times as much as from {1.5 * NOISY_RANGE[1]:g} Hz",
            bool(NOISY_RANGE[0] <= worst <= NOISY_RANGE[1] and np.nanmax(scatter) > words.about * above),
            f"the phase scatters most at {worst:.3g} Hz, by {np.degrees(np.nanmax(scatter)):.2g} degrees, and by "
            f"{np.degrees(above):.2g} above. Assumed, as the thesis states neither: sines of {FORCE_AMPLITUDE:g} N; "
            "places "
            f"with static friction spread evenly over the {STATIC_RANGE[0]:g} to {STATIC_RANGE[1]:g} N of Fig. 20, "
            f"{percent(COULOMB_SHARE)} of it as Coulomb friction",
        ),
    )


@judges("F18", figure="18", needs=(PLANT, BUILT))
def response_of_the_free_joint(evidence: Evidence) -> Finding:
    """Judge whether modes and mass line with the joint free are as the thesis measured them.

    A further question is whether one error of the motor constant explains both masses that the thesis identified.
    """
    plants = evidence.analysis.plants
    stuck, sliding = plants["stuck"], plants["sliding"]
    reads = sorted((stuck.mass, sliding.mass))
    seen, weighed = MEASURED_MASSES[1], WEIGHED_MASSES[1]
    factor = seen / float(np.mean(reads))
    both = "would explain" if abs(factor / CONSTANTS[0] - 1) <= words.close else "does not explain"
    return Finding.of(
        Part(
            f"the first mode is about {FIRST_MODE:g} Hz (within {percent(words.close)}) with the cart stuck",
            bool(abs(stuck.first / FIRST_MODE - 1) <= words.close),
            f"{stuck.first:.3g} Hz stuck, {sliding.first:.3g} Hz sliding: the force hardly moved the cart",
        ),
        Part(
            f"a parasitic mode is about {PARASITIC_MODE:g} Hz (within {percent(words.close)})",
            bool(abs(stuck.parasitic / PARASITIC_MODE - 1) <= words.close),
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
        *on_the_rig(evidence, lambda built: weaker_motor(built, 1, MEASURED_MASSES[1], WEIGHED_MASSES[1])),
    )


JOINT_STIFFNESS = 2.9e3
"""Stiffness of the joint [N/m] in Fig. 19 (Sec. 4.2.2)."""

SPIKE_DELAY = 0.1
"""Time [s] within which a spike of the velocity follows a peak of the deflection."""

_UNIFORM = "uniform friction along the rail, no noise"
"""Assumptions about the simulated rig, in words."""


@judges("F19", figure="19", needs=(STEPPED,), undrawn="the joint's stiffness, which is entered")
def stiffness_from_position_steps(evidence: Evidence) -> Finding:
    """Judge whether position steps with the cart fixed give the joint's stiffness."""
    return judged_steps(evidence.experiments.joint_steps)


def judged_steps(steps: JointSteps) -> Finding:
    """Judge whether simulated position steps give the joint's true stiffness, and the thesis's."""
    read, apparent = steps.result.stiffness, (2 * np.pi * FIRST_MODE) ** 2 * MEASURED_MASSES[1]
    larger = steps.stiffness * float(np.mean(CONSTANTS))
    return Finding.of(
        Part(
            f"read as in Sec. 4.2.2 the steps give the joint's stiffness: the 95 % interval holds it, and is "
            f"within {percent(words.close)} of it",
            bool(read.holds(steps.stiffness) and read.half_width <= words.close * steps.stiffness),
            f"{number_text(read.value / 1e3, '.4g', 'N/mm')} ({read.low / 1e3:.4g} to {read.high / 1e3:.4g}) of "
            f"{steps.stiffness / 1e3:.4g}, {len(steps.result.windows)} settled windows. Assumed: steps back and forth, "
            f"{STANDING_TIME:g} s each; no noise",
            why=read.reason or "The interval misses it, or is wide.",
            self_test=True,
        ),
        Part(
            f"it is {JOINT_STIFFNESS / 1e3:g} N/mm (within {percent(words.close)})",
            bool(abs(read.value / JOINT_STIFFNESS - 1) <= words.close),
            f"{number_text(read.value / 1e3, unit='N/mm')}, as entered by Sec. 3.5; the {FIRST_MODE:g} Hz and "
            f"{MEASURED_MASSES[1]:g} kg that the thesis measured give {apparent / 1e3:.3g} N/mm, not "
            f"{JOINT_STIFFNESS / 1e3:g}",
            beyond="Simulation cannot decide this: cables, misalignment and the motor constant (Sec. 4.2.2) "
            "are not in the model. The last alone, wrong by as much as the masses of Fig. 17 and 18 require, would "
            f"make it {larger / 1e3:.3g} N/mm, and {FIRST_MODE:g} Hz with {MEASURED_MASSES[1]:g} kg are "
            f"{apparent / 1e3:.3g} "
            "too: the force was scaled differently there, or the joint was softer.",
        ),
    )


@judges("F20", figure="20", needs=(SLIPS,), undrawn="the static friction, which is entered")
def static_friction_from_stick_slip(evidence: Evidence) -> Finding:
    """Judge whether stick-slip at several speeds, joint free, gives the static friction."""
    return judged_slips(evidence.experiments.slow_motion)


def judged_slips(runs: tuple[SlowMotion, ...]) -> Finding:
    """Judge whether simulated stick-slip gives the true static friction, and the thesis's peaks.

    `runs` are slow motions at several speeds.
    """
    slips = sum(len(run.result.forces) for run in runs)
    forces, rates = (np.concatenate([getattr(run.result, name) for run in runs]) for name in ("forces", "rates"))
    read = static_friction("friction.static", forces, rates)
    truth = runs[0].static
    counts = ", ".join(f"{len(run.result.forces)} slips at {run.speed * 1e3:g} mm/s" for run in runs)
    range_read = f"{forces.min():.3g} to {forces.max():.3g} N" if slips else "none"
    return Finding.of(
        Part(
            f"at every speed the cart sticks and slips, and a spike of its velocity follows every peak of the "
            f"relative position within {SPIKE_DELAY:g} s",
            all(len(run.result.forces) > 1 and _spikes(run) for run in runs),
            f"{counts}. Assumed: these speeds, {SLOW_TIME:g} s each (the thesis states neither); {_UNIFORM}",
        ),
        Part(
            "read from the peaks at all speeds, the 95 % interval holds the static friction of the rig",
            bool(read.determined and read.holds(truth)),
            f"{number_text(read.value, unit='N')} ({read.low:.3g} to {read.high:.3g}) of {truth:.3g} N: {read.method}",
            why=read.reason or "The interval misses it.",
            self_test=True,
        ),
        Part(
            f"the peaks themselves lie between {STATIC_RANGE[0]:g} and {STATIC_RANGE[1]:g} N",
            bool(slips and forces.min() >= STATIC_RANGE[0] and forces.max() <= STATIC_RANGE[1]),
            range_read,
            beyond=f"Simulation cannot decide this: the static friction of {truth:g} N is entered (Table 2), "
            "and it is more than was measured.",
        ),
    )


def _spikes(run: SlowMotion) -> bool:
    """Tell whether the cart's velocity spikes shortly after every peak of the deflection.

    A spike is more than half of the usual one.
    """
    slips, time = run.result, run.log.time
    after = [(time >= at) & (time <= at + SPIKE_DELAY) for at in slips.times]
    return all(np.abs(slips.cart_velocity[window]).max() > np.median(slips.speeds) / 2 for window in after)


@judges("F21", figure="21", needs=(SPEEDY,), undrawn=RAIL)
def force_at_constant_speed(evidence: Evidence) -> Finding:
    """Judge whether the force oscillates in passes at constant speed, joint free and locked.

    Sec. 4.2.3 claims this for the free joint.
    """
    return judged_speeds(*evidence.experiments.constant_speed)


def force_swings(runs: ConstantSpeed) -> list[float]:
    """Return the force's standard deviation over its mean in each pass.

    The first tenth of the way is left out.
    """
    forces = [runs.log["force"][part] for part in runs.log.segments]
    return [float(np.std(late) / abs(np.mean(late))) for late in (force[len(force) // 10 :] for force in forces)]


def _swing_text(share: float) -> str:
    """Write a fraction to a hundredth of a percent; a smaller one means a steady force."""
    return percent(round(share, 4))


def judged_speeds(free: ConstantSpeed, locked: ConstantSpeed) -> Finding:
    """Judge whether the force oscillates in simulated passes at constant speed, and by position.

    Passes are with the real drive, joint free and locked. Also judge that dynamic friction cannot be determined from
    them.
    """
    named = {"free": free, "locked": locked}
    swings = {name: force_swings(runs) for name, runs in named.items()}
    rows = tuple(
        (name, f"{1e3 * velocity:.3g} mm/s", f"{np.mean(runs.log['force'][part]):.3g} N", _swing_text(swing))
        for name, runs in named.items()
        for velocity, part, swing in zip(runs.velocities, runs.log.segments, swings[name], strict=True)
    )
    repeats = free.result.repeatability
    return Finding.of(
        Part(
            f"the force oscillates in every pass, the joint free (by more than {percent(words.close)} of its mean)",
            bool(swings["free"]) and min(swings["free"]) > words.close,
            f"standard deviation over mean {_between(swings['free'])}, with the joint locked "
            f"{_between(swings['locked'])}. Assumed: friction that varies along the rail",
            why="The simulated rig slides steadily.",
        ),
        Part(
            "the oscillation depends on the position: passes over the same places repeat it (correlation above 0)",
            repeats.determined and repeats.low > 0,
            f"correlation {_interval(repeats)}, with the joint locked {_interval(locked.result.repeatability)}",
            why="The loop itself oscillates, by sticking and slipping.",
        ),
        Part(
            "dynamic friction cannot be determined, joint free or locked",
            not any(runs.result.separated for runs in named.values()),
            f"free: {free.result.verdict} Locked: {locked.result.verdict}",
            why="The passes are steady, and repeat each other.",
        ),
        table=FindingTable(("joint", "velocity", "mean force", "standard deviation over mean"), rows),
    )


def _between(shares: list[float]) -> str:
    """Return the least and the greatest of some fractions."""
    return f"{_swing_text(min(shares))} to {_swing_text(max(shares))}" if shares else "of no pass"


def _interval(estimate: Estimate) -> str:
    """Write a correlation with its interval, or that it was not determined."""
    if not estimate.determined:
        return "not determined"
    return f"{estimate.value:.2f} ({estimate.low:.2f} to {estimate.high:.2f})"
