"""Settings of the judges of the thesis's claims."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class JudgeSettings(Settings):
    """Settings of judges: thresholds in words of the thesis, and numbers of draws."""

    influence_draws: int = setting(1024, "stages")
    """Number of stages drawn for a rank correlation, whose two standard errors are then 0.06."""

    influence_rtol: float = setting(1e-5, "")
    """Relative tolerance of runs for the correlations, ten times tighter than the thesis's. Tighter runs count the same
    peaks."""

    far_crossover_factor: float = setting(3.0, "")
    """Factor of “significantly larger” or “smaller” for a tuned crossover: half a decade, as “far” in all claims. It is
    the other reading of Sec. 3.4.2, whose own 8 Hz then lie too near, though their loop crosses 0 dB at 24 Hz."""

    lowest_crossover_ratio: float = setting(0.03, "")
    """Lowest crossover tried over the first eigenfrequency: 0.3 Hz, low enough that the resonance stays below 0 dB
    while the cart slides. From 0.8 Hz on it reaches 0 dB, and the loop crosses there."""

    crossovers_tried: int = setting(21, "")
    """Number of crossovers tried beside the first eigenfrequency, 30 % apart, finer than “about”."""

    tuned_masses: int = setting(9, "")
    """Number of masses for which the controller is tuned, from the stage's to the whole mass. More show the same
    maximum."""

    leaf_change_factor: float = setting(1.1, "")
    """Factor by which a dimension of the leaves grows, small enough for stiffnesses to change in proportion."""

    negligible_share: float = setting(0.01, "")
    """Largest share that is negligible, for a nonlinearity or a motion. Smaller ones cannot be read off a figure."""

    exact_share: float = setting(1e-9, "")
    """Largest relative difference between numbers that follow from one equation. Rounding is far smaller."""

    first_response: float = setting(0.3, "s")
    """Time for which the initial response lasts, five times that of the move: its overshoot of 28 mm has turned and
    come back by then, and the stage has not stuck yet."""

    build_up_after: float = setting(6.0, "s")
    """Time after which the build-up of the integral action is read, one second after the return begins. By then the
    initial overshoot, of up to 29 mm, is over and the bearing has stuck, at 5.2 to 5.5 s with 1.7 to 5.1 kg; from the
    end of the return on, at 5.06 s, the overshoot would decide."""

    response_work: int = setting(40, "runs")
    """Work of a run in time, in runs of a map, for the progress: 40 ms of processor time against 1 ms."""

    linear_work: int = setting(2500, "runs")
    """Work of the linear analysis of a rig, in runs of a map: 2.5 s of processor time."""

    experiment_work: tuple[tuple[str, int], ...] = setting(
        (
            ("locked_line", 700),
            ("joint_steps", 140),
            ("slow_motion", 90),
            ("constant_speed", 4100),
            ("rig_loops", 1000),
            ("moves", 4600),
            ("grid", 9500),
            ("cycles", 3700),
            ("standstill", 3000),
            ("traces", 1000),
        ),
        "runs",
    )
    """Work of each experiment on a drawn rig, in runs of a map: as measured on three drawn rigs, in milliseconds of
    processor time. Equal work for all told half an hour for claims of half a minute."""

    draw_looks: tuple[int, ...] = setting((7, 17, 51), "draws")
    """Numbers of draws after which a claim is looked at; a claim whose interval has decided is drawn no further. Seven
    draws that all hold lie above `half_share`, seventeen of which none does below `rare_share`, and with fifty-one an
    interval is at most a third wide. Looking three times, each interval may miss by a third of 5 %."""

    rail_count: int = setting(20, "rails")
    """Number of rails, on which a share is known to 22 % at worst. Draws have as many: with 8 instead, F26, which asks
    whether any rail has peaks, held in 4 of 17 draws, not in 9."""

    half_share: float = setting(0.5, "")
    """Share of the draws in which a claim must hold to agree; the whole interval must lie above it. With less, a claim
    could fail in most of what the thesis leaves open."""

    rare_share: float = setting(0.25, "")
    """Largest share of the draws in which a claim that fails at friso's choice may hold, and still fail. The upper end
    of the interval counts: seventeen draws without one that holds show it, and one of 51 does not turn it."""

    stray_share: float = setting(0.05, "")
    """Share that the lower end of an interval must exceed to say that a claim holds in more than stray draws. It is
    that of “few” cells of a map. Twice as much would need ten of 51 draws."""

    least_decided: int = setting(7, "draws")
    """Least number of decided draws. With fewer, even if all agree, the interval of the share reaches below a half."""


settings = JudgeSettings.live()
