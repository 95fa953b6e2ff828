"""Fig. 17 to 21: what the thesis identifies on its rig, by the same experiments on the simulated one.

What is entered in the simulation (masses, stiffness, friction of Table 2) cannot come out otherwise than entered; what
can be judged is whether the experiments show it, and what else they would have to show.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from friso.frequency.describing.mass_line import mass_line
from friso.identify.experiments.rate_effect import static_friction
from friso.studies.thesis.claims import ABOUT, Evidence, Finding, Part, judges
from friso.studies.thesis.experiments import (
    SLOW,
    ConstantSpeed,
    JointSteps,
    SlowMotion,
    constant_speed,
    joint_steps,
    slow_motion,
)
from friso.studies.thesis.linear import PLANT
from friso.studies.thesis.studies import LOCKED, rig

_MEASURED, _WEIGHED = (2.5, 0.75), (1.7, 0.5)
"""Masses [kg] of the whole rig and of its stage: by their mass lines (Fig. 17, 18), and as weighed (Sec. 4.2.1)."""

_CONSTANTS = (_MEASURED[0] / _WEIGHED[0], _MEASURED[1] / _WEIGHED[1])
"""How many times too small the motor constant would have to be taken to read them so."""

_LINE_TO, _NOISY = 200.0, (10.0, 80.0)
"""Up to where the mass line is seen, and where single identifications are noisy [Hz] (Sec. 4.2.1)."""

_FIRST, _PARASITIC = 11.0, 300.0
"""Modes of the free joint [Hz] (Sec. 4.2.1)."""

_STIFFNESS, _STATIC = 2.9e3, (1.0, 2.5)
"""By Fig. 19 [N/m], and by Fig. 20 [N] (Sec. 4.2.2, 4.2.3)."""

_FORCE = 5.0
"""Amplitude [N] of the identification, which the thesis does not tell: some times the friction it finds."""

_PLACES = 4
"""Places of the rail, their static friction spread evenly over what Fig. 20 finds, Coulomb friction a third of it."""

_FREQUENCIES = (5.0, 10.0, 20.0, 40.0, 60.0, 80.0, 120.0, 160.0, 200.0)
"""[Hz], at which the response with friction is computed."""

_CLOSE = 0.1
"""Share within which numbers agree that one error is to explain."""

_SPIKE = 0.1
"""Time [s] within which a spike of the velocity follows a peak of the deflection."""


@cache
def _line() -> tuple[np.ndarray, np.ndarray]:
    """Magnitude of the locked rig over its mass line, places by frequencies, and the scatter of the phase [rad]."""
    static = np.linspace(*_STATIC, _PLACES)
    places = [{"friction.static": f"{f} N", "friction.coulomb": f"{f / 3} N"} for f in static]
    found = mass_line(rig().replace(dict(LOCKED)), places, [_FORCE], _FREQUENCIES)
    return found["magnitude"].values[:, 0], found["spread_phase"].values[0]


@judges("F17", figure="17")
def mass_line_of_the_locked_rig(evidence: Evidence) -> Finding:
    """The mass line with friction at several places."""
    return judged_line(*_line())


def judged_line(magnitude: np.ndarray, scatter: np.ndarray) -> Finding:
    """The finding from the magnitude over the mass line, shape (places, frequencies), and the scatter of the phase."""
    rates = np.array(_FREQUENCIES)
    mean = np.nanmean(magnitude, axis=0)
    on = (mean > 1 / ABOUT) & (mean < ABOUT)
    end = float(max(rates[: len(on) if on.all() else int(on.argmin())], default=0.0))
    inside = (rates >= _NOISY[0]) & (rates <= _NOISY[1])
    mass = _WEIGHED[0] / np.nanmedian(magnitude[:, inside], axis=1)
    worst, above = float(rates[np.nanargmax(scatter)]), float(np.nanmax(scatter[rates >= 1.5 * _NOISY[1]]))
    weighed, seen = _WEIGHED[0], _MEASURED[0]
    return Finding(
        (
            Part(
                f"the response stays on the mass line (within a factor of {ABOUT:g}) up to about {_LINE_TO:g} Hz (at "
                f"least {_LINE_TO / ABOUT:.3g} Hz)",
                end >= _LINE_TO / ABOUT,
                f"up to {end:.3g} Hz, of those computed",
            ),
            Part(
                f"the mass read off it is nearer {seen:g} than the {weighed:g} kg weighed (by their ratios)",
                bool(np.nanmedian(mass) > (seen * weighed) ** 0.5),
                f"{mass.min():.3g} to {mass.max():.3g} kg at {len(mass)} places",
                why="not in the model: friction hardly moves the line. Cables and the motor constant (Sec. 4.2.1) may, "
                f"the latter by the factor {_CONSTANTS[0]:.2f}; Fig. 18 asks for {_CONSTANTS[1]:.2f}. Simulation alone "
                "cannot tell",
            ),
            Part(
                f"identifications at different places differ most between {_NOISY[0]:g} and {_NOISY[1]:g} Hz, by more "
                f"than {ABOUT:g} times what they do from {1.5 * _NOISY[1]:g} Hz",
                bool(_NOISY[0] <= worst <= _NOISY[1] and np.nanmax(scatter) > ABOUT * above),
                f"the phase scatters most at {worst:.3g} Hz, by {np.degrees(np.nanmax(scatter)):.2g} degrees, and by "
                f"{np.degrees(above):.2g} above, with a force of {_FORCE:g} N (which the thesis does not tell)",
            ),
        )
    )


@judges("F18", figure="18", needs=(PLANT,))
def response_of_the_free_joint(evidence: Evidence) -> Finding:
    """Modes and mass line of the free joint, and whether one error would explain both masses."""
    plants = evidence.analysis.plants
    stuck, sliding = plants["stuck"], plants["sliding"]
    reads = sorted((stuck.mass, sliding.mass))
    seen, weighed = _MEASURED[1], _WEIGHED[1]
    factor = seen / float(np.mean(reads))
    both = "would explain" if abs(factor / _CONSTANTS[0] - 1) <= _CLOSE else "does not explain"
    return Finding(
        (
            Part(
                f"the first mode is about {_FIRST:g} Hz (within {_CLOSE:.0%}) with the cart stuck",
                bool(abs(stuck.first / _FIRST - 1) <= _CLOSE),
                f"{stuck.first:.3g} Hz stuck, {sliding.first:.3g} Hz sliding: the force did not move the cart much",
            ),
            Part(
                f"a parasitic mode is about {_PARASITIC:g} Hz (within {_CLOSE:.0%})",
                bool(abs(stuck.parasitic / _PARASITIC - 1) <= _CLOSE),
                f"{stuck.parasitic:.4g} Hz (entered in the simulation, from this figure)",
            ),
            Part(
                f"the mass line between them is nearer {seen:g} than the {weighed:g} kg weighed (by their ratios)",
                bool(reads[0] > (seen * weighed) ** 0.5),
                f"{reads[0]:.3g} to {reads[1]:.3g} kg",
                why=f"not in the model: the line lies by a factor of {factor:.2f} off, in Fig. 17 by "
                f"{_CONSTANTS[0]:.2f}: one error of the motor constant {both} both (to {_CLOSE:.0%}), and the first "
                "mode does not hang on it. Simulation alone cannot tell",
            ),
        )
    )


@judges("F19", figure="19")
def stiffness_from_position_steps(evidence: Evidence) -> Finding:
    """The steps of the rig with its cart fixed."""
    return judged_steps(_steps())


@cache
def _steps() -> JointSteps:
    return joint_steps(rig())


def judged_steps(steps: JointSteps) -> Finding:
    """The finding from the simulated steps."""
    read, apparent = steps.found.stiffness, (2 * np.pi * _FIRST) ** 2 * _MEASURED[1]
    larger = steps.stiffness * float(np.mean(_CONSTANTS))
    return Finding(
        (
            Part(
                f"read as in Sec. 4.2.2 the steps give the joint's stiffness: the 95 % interval holds it, and is "
                f"within {_CLOSE:.0%} of it",
                bool(read.holds(steps.stiffness) and read.half_width <= _CLOSE * steps.stiffness),
                f"{read.value / 1e3:.4g} N/mm ({read.low / 1e3:.4g} to {read.high / 1e3:.4g}) of "
                f"{steps.stiffness / 1e3:.4g}, {len(steps.found.windows)} settled windows",
                why=read.reason or "method: the interval misses it, or is wide",
            ),
            Part(
                f"it is {_STIFFNESS / 1e3:g} N/mm (within {_CLOSE:.0%})",
                bool(abs(read.value / _STIFFNESS - 1) <= _CLOSE),
                f"{read.value / 1e3:.3g} N/mm, as entered by Sec. 3.5",
                why=f"not in the model: cables, misalignment, the motor constant (Sec. 4.2.2). The latter alone, wrong "
                f"as the masses of Fig. 17 and 18 ask for, would make it {larger / 1e3:.3g} N/mm, and {_FIRST:g} Hz "
                f"with {_MEASURED[1]:g} kg are {apparent / 1e3:.3g} too: the force was scaled otherwise there, or "
                "the joint softer. Simulation alone cannot tell",
            ),
        )
    )


@judges("F20", figure="20")
def static_friction_from_stick_slip(evidence: Evidence) -> Finding:
    """Slow motion with the joint free, at several speeds."""
    return judged_slips(_slow())


@cache
def _slow() -> tuple[SlowMotion, ...]:
    return tuple(slow_motion(rig(), speed) for speed in SLOW)


def judged_slips(runs: tuple[SlowMotion, ...]) -> Finding:
    """The finding from simulated slow motion."""
    slips = sum(len(each.found.forces) for each in runs)
    forces, rates = (np.concatenate([getattr(each.found, name) for each in runs]) for name in ("forces", "rates"))
    read = static_friction("friction.static", forces, rates)
    truth = runs[0].static
    range_read = f"{forces.min():.3g} to {forces.max():.3g} N" if slips else "none"
    return Finding(
        (
            Part(
                f"at every speed the cart sticks and slips, and a spike of its velocity follows every peak of the "
                f"relative position within {_SPIKE:g} s",
                all(len(each.found.forces) > 1 and _spikes(each) for each in runs),
                ", ".join(f"{len(each.found.forces)} slips at {each.speed * 1e3:g} mm/s" for each in runs),
            ),
            Part(
                "read from the peaks at all speeds, the 95 % interval holds the static friction of the rig",
                bool(read.shown and read.holds(truth)),
                f"{read.value:.3g} N ({read.low:.3g} to {read.high:.3g}) of {truth:.3g}: {read.method}",
                why=read.reason or "method: the interval misses it",
            ),
            Part(
                f"the peaks themselves lie between {_STATIC[0]:g} and {_STATIC[1]:g} N",
                bool(slips and forces.min() >= _STATIC[0] and forces.max() <= _STATIC[1]),
                f"{range_read}, lower the faster the motion",
                why=f"input: Table 2 takes {truth:g} N, more than was measured. Besides, peaks read at a finite speed "
                f"lie below the static friction, here by up to {1 - forces.min() / truth:.0%}"
                if slips
                else "no slips",
            ),
        )
    )


def _spikes(run: SlowMotion) -> bool:
    """Whether the velocity of the cart spikes after every peak, to more than half of the usual."""
    found, time = run.found, run.log.time
    after = [(time >= at) & (time <= at + _SPIKE) for at in found.times]
    return all(np.abs(found.cart_velocity[each]).max() > np.median(found.speeds) / 2 for each in after)


@judges("F21", figure="21")
def force_at_constant_speed(evidence: Evidence) -> Finding:
    """Both speeds with the joint free and locked."""
    return judged_speeds(*_constant())


@cache
def _constant() -> tuple[ConstantSpeed, ConstantSpeed]:
    return constant_speed(rig()), constant_speed(rig().replace(dict(LOCKED)))


def judged_speeds(free: ConstantSpeed, locked: ConstantSpeed) -> Finding:
    """The finding from the simulated runs."""
    named = {"free": free.found, "locked": locked.found}
    swings = {name: [each.spread / abs(each.mean.value) for each in found.passes] for name, found in named.items()}
    listed = "; ".join(f"{name} {', '.join(f'{s:.2g}' for s in shares)}" for name, shares in swings.items())
    repeats = ", ".join(f"{name} {found.repeatability.value:.2f}" for name, found in named.items())
    return Finding(
        (
            Part(
                f"the force oscillates at both speeds, joint free or locked (by more than {_CLOSE:.0%} of its mean)",
                all(shares and min(shares) > _CLOSE for shares in swings.values()),
                f"standard deviation over mean at {' and '.join(f'{v * 1e3:g}' for v in free.speeds)} mm/s: {listed}",
                why="locked, the simulated rig slides steadily where it is fast enough",
            ),
            Part(
                "the oscillation goes with the place: passes over the same places repeat it",
                all(found.repeatability.shown and found.repeatability.low > 0 for found in named.values()),
                f"correlation of the two speeds: {repeats}",
                why="not in the model: its friction is alike all along the rail, and what swings is the loop, by "
                "sticking and slipping. Simulation alone cannot tell",
            ),
            Part(
                "dynamic friction cannot be read off, joint free or locked",
                not any(found.separated for found in named.values()),
                f"free: {free.found.verdict} Locked: {locked.found.verdict}",
            ),
        )
    )
