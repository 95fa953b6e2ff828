"""List the questions that the thesis leaves open, with the command that answers each.

Also list the steps of the thesis's design method.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from friso.evidence import value
from friso_thesis.studies.thesis.space import OPEN
from friso_thesis.studies.thesis.studies import rig_crossover, rig_gains

if TYPE_CHECKING:
    from friso_thesis.studies.thesis.reproduce import Reproduction


@dataclass(frozen=True)
class ThesisQuestion:
    """A question that the thesis leaves open.

    `asked` names the section that asks it. `command` is the command of friso that answers it, and `shows` says what the
    result means. `answer` returns the answer for the thesis's rig, from stored findings.
    """

    asked: str
    command: str
    shows: str
    answer: Callable[[], str]


def _friction() -> str:
    kept = partial(value, "rig.constant-speed")
    return (
        f"with 3 N, 1 N, 0.5 N s/m and 1.6 mm/s in the simulation, {kept('min_static_n'):.2g} to "
        f"{kept('max_static_n'):.2g} N static, {kept('min_coulomb_n'):.2g} to {kept('max_coulomb_n'):.2g} N "
        f"Coulomb, {kept('min_viscous_n_s_per_m'):.2g} to {kept('max_viscous_n_s_per_m'):.2g} N s/m and "
        f"{1e3 * kept('min_stribeck_m_per_s'):.3g} to {1e3 * kept('max_stribeck_m_per_s'):.3g} mm/s are read at "
        "places of a rail along which friction varies"
    )


def _standstill() -> str:
    kept = partial(value, "rig.in-position")
    return (
        f"with a quiet floor and amplifier noise the free stage moves {kept('rms_ratio'):.2g} times as much (RMS) as "
        f"the locked one; peaks {1e6 * kept('free_peak_m'):.2g} um against {1e6 * kept('locked_peak_m'):.2g} um"
    )


def _rails() -> str:
    kept = partial(value, "rig.hunting")
    return (
        f"at 8 Hz peaks are counted on {kept('locked_at_8_hz'):.0f} of {kept('rails'):.0f} rails with the joint "
        f"locked, on {kept('free_at_8_hz'):.0f} with it free"
    )


def _edges() -> str:
    return (
        f"with the joint locked a cycle attracts up to {value('hunting.locked-rig', 'edge_hz'):.3g} Hz, whatever the "
        "move"
    )


def _rejection() -> str:
    kept = partial(value, "hunting.adrc")
    return (
        f"disturbance rejection hunts too: with the joint locked up to a bandwidth of {kept('edge_hz'):.2g} Hz, at "
        f"which its loop crosses 0 dB at {kept('crossing_hz'):.3g} Hz, the PID up to "
        f"{value('hunting.locked-rig', 'edge_hz'):.3g} Hz"
    )


QUESTIONS: tuple[ThesisQuestion, ...] = (
    ThesisQuestion(
        "Friction cannot be identified exactly (Sec. 4.2.3, 5)",
        "friso rig constant-speed examples/thesis_drive.toml",
        "which experiment reveals static, Coulomb and viscous friction and the Stribeck velocity, with intervals; "
        "friso identify reads them from measured logs",
        _friction,
    ),
    ThesisQuestion(
        "Little damping in the joint, and less stability in position (Sec. 4.3.2)",
        "friso rig in-position examples/thesis_drive.toml",
        "which disturbance moves the stage, and what more damping recovers",
        _standstill,
    ),
    ThesisQuestion(
        "Not all relations between parameters are taken into account (Sec. 5)",
        "friso tune examples/thesis_rig.toml",
        "all settings at once: the least change that stops hunting; friso guideline has the law over all groups",
        lambda: f"beyond pairs: {len(OPEN)} values are drawn jointly here, and a claim names those that decide on it",
    ),
    ThesisQuestion(
        "Friction depends on the position (Sec. 4.2.3, 4.3.2)",
        "friso rig hunting examples/thesis_drive.toml",
        "the same moves on twenty rails along which friction varies",
        _rails,
    ),
    ThesisQuestion(
        "The count of peaks is no proper measure (Sec. 5)",
        "friso check examples/thesis_rig.toml",
        "the cycle itself, its amplitude, its multiplier, and the crossover above which none attracts",
        _edges,
    ),
    ThesisQuestion(
        "Other control than PID is out of scope (Sec. 5)",
        'friso check --set joint.locked=true --set \'controller={kind="adrc", bandwidth="3 Hz", tuned_mass="1.7 kg"}\' '
        "examples/thesis_rig.toml",
        "whether active disturbance rejection hunts, and up to which bandwidth",
        _rejection,
    ),
)


def question_rows() -> list[Sequence[str]]:
    """Return the open questions, with commands to answer them, and the rig's answers."""
    return [(question.asked, question.command, question.shows, question.answer()) for question in QUESTIONS]


STATIC_FRICTION, JOINT_STROKE = 3.0, 1e-3
PARASITIC_FREQUENCY, IDENTIFIED_MASS = 360.0, 2.5


def method_rows(reproduction: Reproduction) -> list[Sequence[str]]:
    """Return the steps of the thesis's design method (Sec. 3.4), one row each.

    A row has what the thesis does, what friso finds at the thesis's values, and what `friso design` makes of the
    specification (stored).
    """
    single = reproduction.linear.locked.single if reproduction.linear else None
    reached = (
        f"by Sec. 3.4.2 up to {single:.3g} Hz, where a mode reaches 0 dB too" if single else "not computed in this run"
    )
    limits = {v.claim.id: v for v in reproduction.verdicts}
    gap = _number(limits.get("F12A"), 0)
    softest = STATIC_FRICTION / JOINT_STROKE
    built = partial(value, "design.thesis")
    needed = "an isolator is needed" if built("needed") else "no isolator is needed"
    return [
        (
            "1. Crossover that can be reached",
            "8 Hz chosen, so that it hunts; up to 60 Hz possible",
            reached,
            f"up to {built('limit_hz'):g} Hz by the specification; without a joint some corner of it hunts up to "
            f"{built('without_edge_hz'):.3g} Hz: {needed}",
        ),
        (
            "2. Friction of the bearing, its gap",
            "static 1 to 2.5 N measured; hunting from a gap of about 1 N",
            gap,
            "ranges: static 1 to 3 N, the gap 0.3 to 0.85 of it, the worst corner counting",
        ),
        (
            "3. Drive stiffness from static friction and stroke",
            f"{STATIC_FRICTION:g} N over {JOINT_STROKE * 1e3:g} mm allow {softest / 1e3:g} N/mm; built: 2.4 N/mm, "
            "first parasitic "
            f"mode {PARASITIC_FREQUENCY:g} Hz",
            f"built: {2.4e3 * JOINT_STROKE:.2g} N at full stroke; parasitic mode at "
            f"{PARASITIC_FREQUENCY / rig_crossover():.3g} "
            f"times the crossover (10 wanted): it would allow {PARASITIC_FREQUENCY / 10:.3g} Hz",
            f"{built('stiffness_n_per_m') / 1e3:.2g} N/mm over {1e3 * built('stroke_m'):.2g} mm: "
            f"{built('force_n'):.2g} N of the least {built('least_static_n'):.2g} N; first interfering mode "
            f"{built('interfering_hz'):.3g} Hz",
        ),
        (
            "4. Gains for the largest mass",
            "Eq. 7, 8 with the mass identified",
            "; ".join(f"{mass:g} kg: {_gain_text(*rig_gains(mass))}" for mass in (1.7, IDENTIFIED_MASS)),
            f"{built('crossover_hz'):g} Hz: {_gain_text(*map(built, _GAINS))}; least modulus margin "
            f"{built('margin'):.2g}",
        ),
        (
            "5. Verification",
            "moves on the rig (Sec. 4.3)",
            "Fig. 24 to 28 on the virtual rig",
            f"{built('not_at_rest'):.0f} of {built('moves'):.0f} moves do not come to rest; 95 % settle in "
            f"{built('settling_s'):.2g} s, with the joint locked in {built('locked_settling_s'):.2g} s",
        ),
    ]


_GAINS = "kp_n_per_m", "ki_n_per_m_s", "kd_n_s_per_m"


def _number(verdict: object, part: int) -> str:
    finding = getattr(verdict, "finding", None)
    return finding.parts[part].number if finding else "not computed in this run"


def _gain_text(proportional: float, integral: float, derivative: float) -> str:
    return f"kp {proportional:.0f} N/m, ki {integral:.0f} N/(m s), kd {derivative:.4g} N s/m"
