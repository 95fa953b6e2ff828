"""Judge the plant (Fig. 7), the open loops, and how fast the controller may be (8, 22, 23)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from friso.frequency.bode import COMFORTABLE_MARGIN, HIGHEST_CROSSOVER, Range
from friso.frequency.margins import Margins
from friso.quantities import percent
from friso_thesis.studies.thesis.claims import Evidence, Finding, FindingTable, Part, judges, number_text
from friso_thesis.studies.thesis.experiments import BUILT
from friso_thesis.studies.thesis.judges.rig_loops import RAIL, measured_free, measured_locked, on_the_rig
from friso_thesis.studies.thesis.linear import FREE, LOCKED_LOOP, PLANT, Linear
from friso_thesis.studies.thesis.linear.loops import (
    FURTHER_CROSSING,
    IDENTIFIED,
    LITTLE,
    SAMPLED,
    Contact,
    CrossoverLoops,
)
from friso_thesis.studies.thesis.linear.plants import PARASITIC_FREQUENCY, LimitCase, Speeds
from friso_thesis.studies.thesis.reading import about, words

FIRST_FREQUENCY = 10.0
"""Eigenfrequency of the free joint [Hz] in the thesis (Sec. 3.4.2)."""

_FREE, _TOUCHED = ("stuck", "sliding"), ("stuck-touched", "sliding-touched")


@judges("F7", figure="7", needs=(PLANT,))
def four_limit_cases(evidence: Evidence) -> Finding:
    """Judge resonances, antiresonances and mass lines of the plant in the four limit cases."""
    plants = evidence.analysis.plants
    return Finding.of(
        *_joint_modes(plants), *_high_modes(plants), _mass_lines(plants, _masses(evidence)), table=_table(plants)
    )


def _table(plants: Mapping[str, LimitCase]) -> FindingTable:
    """Return a table with modes and mass line of the plant in each limit case."""
    rows = []
    for name in (*_FREE, *_TOUCHED):
        case = plants[name]
        pair = case.pair_above
        above = f"{pair[0]:.4g} and {pair[1]:.4g} Hz" if pair else "none"
        below = ", ".join(f"{f:.3g} Hz" for f in case.antiresonances if f < case.first) or "none"
        rows.append((name, below, f"{case.first:.4g} Hz", f"{case.parasitic:.4g} Hz", above, f"{case.mass:.3g} kg"))
    columns = ("limit case", "antiresonance below", "first resonance", "parasitic mode", "pair above it", "mass line")
    return FindingTable(columns, tuple(rows))


def _joint_modes(plants: Mapping[str, LimitCase]) -> tuple[Part, Part]:
    """Judge the free joint's first resonance, and whether an antiresonance lies below it.

    There should be one if the cart slides, and none if it is stuck.
    """
    low = {name: [f for f in plants[name].antiresonances if f < plants[name].first] for name in _FREE}
    pair = f"antiresonance {low['sliding'][-1]:.3g} Hz, resonance" if low["sliding"] else "no antiresonance below"
    return (
        Part(
            f"with the limiter free, the first resonance is about {FIRST_FREQUENCY:g} Hz (from "
            f"{FIRST_FREQUENCY / words.about:.3g} to "
            f"{FIRST_FREQUENCY * words.about:.3g} Hz), stuck and sliding",
            all(about(plants[name].first, FIRST_FREQUENCY) for name in _FREE),
            ", ".join(f"{name} {plants[name].first:.3g} Hz" for name in _FREE),
        ),
        Part(
            "an antiresonance lies below that resonance where the cart slides, and none where it is stuck",
            bool(low["sliding"] and not low["stuck"]),
            f"sliding: {pair} {plants['sliding'].first:.3g} Hz; stuck: {len(low['stuck'])} antiresonances below it",
        ),
    )


def _high_modes(plants: Mapping[str, LimitCase]) -> tuple[Part, Part, Part]:
    """Judge the parasitic mode, and the two modes above it if the limiter is touched."""
    names = (*_FREE, *_TOUCHED)
    pairs = {name: plants[name].pair_above for name in _TOUCHED}
    free = [name for name in _FREE if plants[name].pair_above]
    listed = [f"{name} {pair[0]:.4g} and {pair[1]:.4g} Hz" for name, pair in pairs.items() if pair]
    series = [f"{name} {_and(plants[f'{name}-series'])}" for name in _TOUCHED]
    ratio = max((pair[1] / plants[name].parasitic for name, pair in pairs.items() if pair), default=float("inf"))
    above = all(pairs.values())
    return (
        Part(
            f"in all four cases a resonance is about {PARASITIC_FREQUENCY:g} Hz (from "
            f"{PARASITIC_FREQUENCY / words.about:.3g} to "
            f"{PARASITIC_FREQUENCY * words.about:.3g} Hz)",
            all(about(plants[name].parasitic, PARASITIC_FREQUENCY) for name in names),
            ", ".join(f"{name} {plants[name].parasitic:.4g} Hz" for name in names),
            why="With the limiter touched the parasitic mass swings against cart and stage, not against the stage.",
        ),
        Part(
            "with the limiter touched, an antiresonance and then a resonance lie above the parasitic mode, and with it "
            "free none",
            above and not free,
            f"{', '.join(listed) or 'none'}; with the formula that Table 1 prints for a touched limiter, no more modes "
            f"than with it free: {'; '.join(series)}",
        ),
        Part(
            f"that pair lies just above it: its resonance within half a decade of it (a factor of {words.order:.2g})",
            above and ratio <= words.order,
            f"a factor of {ratio:.2g}" if above else "no pair",
            why=_why_far(ratio) if above else "",
        ),
    )


def _why_far(ratio: float) -> str:
    return (
        "The model idealises the pair: it is that of the cart on the limiter, and of cart and stage against each other "
        "on it, with k_l of 2e7 N/m as printed (Sec. 3.2.3). Its frequency scales roughly with the root of k_l, which "
        f"would have to be {(ratio / words.order) ** 2:.2g} times smaller, and its resonance with the part of the "
        "stage's mass that the parasitic mode leaves."
    )


def _masses(evidence: Evidence) -> dict[bool, float]:
    """Return the mass [kg] that moves above the first eigenfrequency, by the limiter's state.

    The key is True for a touched limiter, and False for a free one.
    """
    flat = evidence.rig.flat()
    return {False: flat["masses.stage"], True: flat["masses.cart"] + flat["masses.stage"]}


def _mass_lines(plants: Mapping[str, LimitCase], expected: Mapping[bool, float]) -> Part:
    masses = {name: plants[name].mass for name in (*_FREE, *_TOUCHED)}
    listed = ", ".join(f"{name} {mass:.3g} kg at {plants[name].mass_at:.3g} Hz" for name, mass in masses.items())
    return Part(
        f"below the parasitic mode the magnitude follows about {expected[False]:.3g} kg (within a factor of "
        f"{words.about:g}) with the limiter free and about {expected[True]:.3g} kg with it touched",
        all(about(mass, expected[name in _TOUCHED]) for name, mass in masses.items()),
        f"{listed}; it is the limiter that distinguishes them, not, as Sec. 3.4.2 says, sticking and slipping",
    )


def _and(case: LimitCase) -> str:
    return " and ".join(f"{f:.4g}" for f in case.resonances) + " Hz"


@judges("F7L", figure="7", needs=(PLANT,))
def spring_mass_and_damper_lines(evidence: Evidence) -> Finding:
    """Judge which lines the plant follows far below its resonances: a spring if stuck, mass and damper if sliding."""
    analysis = evidence.analysis
    low = {name: analysis.plants[name].low for name in (*_FREE, *_TOUCHED)}
    spring = {"stuck": analysis.springs.joint, "stuck-touched": analysis.springs.bristles}
    slides = {name: low[name] for name in low if name.startswith("sliding")}
    whole = _masses(evidence)[True]
    return Finding.of(
        Part(
            "with the cart stuck it is a spring at low frequency: about as stiff as the joint (within a factor of "
            f"{words.about:g}), and with the limiter touched as the bristles before sliding",
            all(about(low[name].stiffness, stiffness) for name, stiffness in spring.items()),
            " and ".join(f"{low[name].stiffness:.4g} N/m of {stiffness:.4g}" for name, stiffness in spring.items()),
            why="The spring there is another.",
        ),
        Part(
            f"with the cart sliding it follows the mass line of about the whole {whole:.3g} kg, without a spring",
            all(about(one.mass, whole) and abs(one.stiffness) < LITTLE_SPRING for one in slides.values()),
            ", ".join(f"{name} {one.mass:.3g} kg" for name, one in slides.items()),
            why="Another mass moves there.",
        ),
        Part(
            "at even lower frequencies the damper dominates: the mass line ends far below the first resonance (by a "
            f"factor of more than {words.order:.2g})",
            all(
                one.damping > 0 and analysis.plants[name].first > words.order * one.corner
                for name, one in slides.items()
            ),
            ", ".join(f"{name} {one.damping:.3g} N s/m, below {one.corner:.2g} Hz" for name, one in slides.items()),
            why="The damper outweighs the mass up to the resonance.",
        ),
    )


LITTLE_SPRING = 1e-3
"""Stiffness [N/m] below which a sliding plant has no spring: rounding leaves a millionth of it."""


SIMULATED_HIGHEST, MEASURED_HIGHEST = 60.0, 48.0
"""Highest crossovers of the simulation (Sec. 3.4.2) and of the rig (Sec. 4.2.4) [Hz]."""

FREE_CROSSING = 20.0
"""Frequency [Hz] at which the free rig, tuned to 8 Hz, crossed 0 dB (Sec. 4.2.4)."""


@judges("F8", figure="8", needs=(FREE, LOCKED_LOOP))
def stable_at_every_speed(evidence: Evidence) -> Finding:
    """Judge whether the loop is stable at every speed of the cart.

    Also judge how speed changes the loop, and up to which crossover it may be tuned by the design method.
    """
    analysis = evidence.analysis
    single = analysis.free.single
    return Finding.of(
        _stable_at_speeds(analysis.speeds),
        Part(
            f"between the prescribed speeds the loop differs far (by more than a factor of {words.order:.2g}) at a "
            f"tenth of the crossover, and hardly (at most {words.about:g}) at ten times",
            analysis.speeds.slow > words.order and analysis.speeds.fast <= words.about,
            f"factor {analysis.speeds.slow:.3g} at a tenth, {analysis.speeds.fast:.3g} at ten times",
        ),
        Part(
            "by the design method of Sec. 3.4.2 (the loop of the whole mass, sliding, crosses 0 dB once) the "
            f"crossover may be up to {SIMULATED_HIGHEST:g} Hz (or what is the same, {percent(words.same)} less)",
            single is None or single >= (1 - words.same) * SIMULATED_HIGHEST,
            f"up to {_hertz(single)}, where {_beyond(analysis.locked)}; all limit cases are stable up to "
            f"{_hertz(analysis.free.unsampled)} in continuous time; {_edges(analysis, SIMULATED_HIGHEST)}",
            why="Below that the parasitic mode reaches 0 dB too, whose mass and damping the thesis leaves open.",
        ),
    )


def _beyond(locked: CrossoverLoops) -> str:
    """Say where the locked loop, tuned to the highest crossover, crosses 0 dB again."""
    further = _further(locked.margins[MEASURED_HIGHEST]["sliding"], MEASURED_HIGHEST)
    return f"a mode reaches it too (locked, tuned to {MEASURED_HIGHEST:g} Hz: {_frequencies(further)})"


def _stable_at_speeds(speeds: Speeds) -> Part:
    """Judge the stability of the loop as Fig. 8 linearises it, about initial cart speeds."""
    unstable = {"limiter free": speeds.unstable, "touched": speeds.unstable_touched}
    where = [f"{name} {_speeds(ranges)}" for name, ranges in unstable.items() if ranges]
    steady = f"unstable with {', '.join(where)}" if where else "stable at every speed too"
    if speeds.incurable:
        highest = f"{HIGHEST_CROSSOVER / 1e3:g} kHz"
        steady += f", and in the middle of that range no faster controller up to {highest} is stable"
    return Part(
        "linearised about an initial speed of the cart, the bristles not yet deflected (z = 0), the loop is stable at "
        "every speed, its limiter free",
        not speeds.undeflected,
        f"{f'unstable {_speeds(speeds.undeflected)}' if speeds.undeflected else 'stable at every speed'}; with the "
        f"bristles deflected as in steady sliding, where friction falls as the speed rises, it is {steady}",
        why="The deflection of the bristles does not matter there.",
    )


def _speeds(ranges: tuple[Range, ...]) -> str:
    return " and ".join(f"from {low * 1e3:.2g} to {high * 1e3:.2g} mm/s" for low, high in ranges)


@judges("F22", figure="22", needs=(LOCKED_LOOP, BUILT), undrawn=RAIL)
def locked_loops_cross_where_tuned(evidence: Evidence) -> Finding:
    """Judge whether loops of the locked rig, sliding, cross 0 dB where they are tuned."""
    settings = {f: cases["sliding"] for f, cases in evidence.analysis.locked.margins.items()}
    tuned = {f: crossing_nearest(loop, f) for f, loop in settings.items()}
    lowest, highest = min(settings), max(settings)
    further = _further(settings[highest], highest)
    near = min(further, key=lambda f: abs(np.log(f / FURTHER_CROSSING)), default=np.nan)
    return Finding.of(
        Part(
            f"at every setting from {lowest:g} to {highest:g} Hz the sliding rig crosses 0 dB about there (within "
            f"a factor of {words.about:g})",
            all(about(crossing, f) for f, crossing in tuned.items()),
            ", ".join(f"{crossing:.3g} Hz tuned to {f:g}" for f, crossing in tuned.items()),
        ),
        Part(
            f"at the highest setting another crossing of 0 dB is about {FURTHER_CROSSING:g} Hz (from "
            f"{FURTHER_CROSSING / words.about:.3g} to {FURTHER_CROSSING * words.about:.3g} Hz)",
            about(near, FURTHER_CROSSING),
            f"tuned to {highest:g} Hz it crosses again at {_frequencies(further)}, to {lowest:g} Hz at "
            f"{_frequencies(_further(settings[lowest], lowest))}",
            beyond=f"Simulation cannot decide this. {_why_elsewhere(evidence.analysis.contact)}",
        ),
        _threatened(settings[highest], highest, further),
        *on_the_rig(evidence, measured_locked),
    )


def _why_elsewhere(contact: Contact) -> str:
    """Say which change of the model would make the loop cross 0 dB where the thesis measured it."""
    soft, undamped = (_further(loop_margins, MEASURED_HIGHEST) for loop_margins in (contact.margins, contact.undamped))
    return (
        "No mode of the locked model lies there. The contact of cart and stage would with k_l of "
        f"{contact.stiffness:.2g} N/m (Sec. 3.2.3: 2e7 N/m, for limiters, not for fixtures): further crossings then "
        f"{_frequencies(soft)} with the limiter damping of the rig, {_frequencies(undamped)} with {LITTLE}. Or it is "
        "the frame of the encoder's scale, in which Sec. 4.3.1 saw resonances, and which is not in the model."
    )


def _threatened(margins: Margins, setting: float, further: tuple[float, ...]) -> Part:
    """Judge whether a further crossing of 0 dB takes the loop close to instability.

    `setting` is the tuned crossover, and `further` are the crossings above it [Hz].
    """
    close = any(about(margins.closest, f) for f in further)
    where = (
        f"distance {margins.modulus_margin:.2g} from -1, at {margins.closest:.3g} Hz" if margins.stable else "unstable"
    )
    return Part(
        "at the highest setting that crossing threatens stability: about there the loop comes closer to -1 than "
        f"{COMFORTABLE_MARGIN:g} (or it is unstable)",
        bool(further) and (not margins.stable or (close and margins.modulus_margin < COMFORTABLE_MARGIN)),
        where,
        beyond="Simulation cannot decide this: the mode that the thesis saw there is not in the model"
        + (
            f"; without it, it would take a delay of {_micro(margins.delay_margin)} at {setting:g} Hz."
            if margins.stable
            else "."
        ),
    )


@judges("F23", figure="23", needs=(FREE, LOCKED_LOOP, BUILT), undrawn=RAIL)
def free_loop_crosses_above(evidence: Evidence) -> Finding:
    """Judge where the loop of the free joint, tuned for the whole mass, crosses 0 dB.

    The highest crossover up to which it is stable is judged as well.
    """
    analysis = evidence.analysis
    cases = analysis.free.margins[min(analysis.free.margins)]
    crossing = {name: crossing_nearest(cases[name], FREE_CROSSING) for name in ("stuck", "sliding")}
    crossed = ", ".join(f"{name} {number_text(f, unit='Hz')}" for name, f in crossing.items())
    highest = analysis.free.unsampled
    return Finding.of(
        Part(
            f"tuned to {min(analysis.free.margins):g} Hz for the whole mass, the free joint's loop crosses 0 dB "
            f"about {FREE_CROSSING:g} Hz (from {FREE_CROSSING / words.about:.3g} to {FREE_CROSSING * words.about:.3g} "
            "Hz), "
            "stuck and sliding",
            all(about(f, FREE_CROSSING) for f in crossing.values()),
            f"{crossed}; with the masses identified ({', tuned for '.join(IDENTIFIED.values())}) "
            f"{crossing_nearest(analysis.identified, FREE_CROSSING):.3g} Hz",
        ),
        Part(
            f"the setting up to which all limit cases are stable is about {MEASURED_HIGHEST:g} Hz (from "
            f"{MEASURED_HIGHEST / words.about:.3g} to {MEASURED_HIGHEST * words.about:.3g} Hz)",
            highest is not None and about(highest, MEASURED_HIGHEST),
            f"in continuous time {_hertz(highest)}; sampled, see the table; {_edges(analysis, MEASURED_HIGHEST)}",
            beyond="Simulation cannot decide this: the rig's controller samples and delays, but the thesis "
            "gives no delay, and its frame has resonances (Sec. 4.3.1) that the model does not have.",
        ),
        *on_the_rig(evidence, measured_free),
        table=_sampled(analysis),
    )


def crossing_nearest(margins: Margins, frequency: float) -> float:
    """Return the crossing of 0 dB closest to a frequency [Hz]; NaN without any."""
    return min(margins.crossovers, key=lambda f: abs(np.log(f / frequency)), default=np.nan)


def _further(margins: Margins, setting: float) -> tuple[float, ...]:
    """Return the 0 dB crossings [Hz] above the one nearest to the crossover `setting` [Hz]."""
    return tuple(f for f in margins.crossovers if f > crossing_nearest(margins, setting))


def _frequencies(frequencies: tuple[float, ...]) -> str:
    return f"{' and '.join(f'{f:.4g}' for f in frequencies)} Hz" if frequencies else "none"


def _hertz(crossover: float | None) -> str:
    return f"{HIGHEST_CROSSOVER / 1e3:g} kHz, the end of the search" if crossover is None else f"{crossover:.4g} Hz"


def _sampled(analysis: Linear) -> FindingTable:
    """Return a table of the highest stable crossover with sampling, by delay."""
    rows = tuple(
        (_micro(delay), _hertz(free), _hertz(analysis.locked.sampled[delay]))
        for delay, free in analysis.free.sampled.items()
    )
    return FindingTable((f"delay, sampled at {SAMPLED}", "highest stable setting, joint free", "joint locked"), rows)


def _edges(analysis: Linear, setting: float) -> str:
    """Say at which delays the loop tuned to a crossover [Hz] is at the edge of stability.

    The crossover is `setting`; the delays are those with the joint free and locked.
    """
    edges = {"free": analysis.free.delay_at[setting], "locked": analysis.locked.delay_at[setting]}
    parts = [
        f"{name} {f'with a delay of {_micro(at)}' if np.isfinite(at) else 'beyond it'}" for name, at in edges.items()
    ]
    return f"sampled at {SAMPLED}, {setting:g} Hz is at the edge of stability: {', '.join(parts)}"


def _micro(seconds: float) -> str:
    return f"{seconds * 1e6:.0f} us"
