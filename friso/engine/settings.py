"""Settings of the engine: steps, room for results, work, and the building of machine code."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class StepSettings(Settings):
    """Settings of the steps of a run.

    Apart from the first and the longest step they are written into the machine code by the process that builds it, and
    kept with the code. Other values given for a block change nothing there.
    """

    first_step: float = setting(1e-3, "1/natural frequencies")
    """First step, also after a corner of the reference. A longer one may be rejected many times; a shorter one costs
    some steps."""

    longest_step_share: float = setting(1 / 200, "of the duration")
    """Longest step. A longer one could pass over an event."""

    step_safety: float = setting(0.77, "")
    """Factor on the step that the error estimate would allow. Larger values reject more steps than they save."""

    kink_hysteresis: float = setting(3e-3, "of the tolerance")
    """Distance beyond a kink at which it counts as crossed. A run that has crossed a kink is then clear of it, and
    rounding noise crosses nothing."""

    surface_rounding: float = setting(2e-15, "of the terms of a surface")
    """Least hysteresis: nine units in the last place of the terms. With less, rounding noise crosses kinks."""

    step_after_kink: float = setting(0.25, "of the proposed step")
    """Step after a kink, behind which the motion may be much faster."""

    narrow_peak_widths: float = setting(3.0, "widths of the narrow peak about a kink")
    """Distance of a step's start from a kink from which it may pass over the peak, because all of its stages may lie
    beyond. Such a step is repeated up to the kink if it crosses the kink and ends beyond the peak, or on this side
    again."""

    least_turning_rate: float = setting(1e-6, "of the velocity's tolerance")
    """Rate below which a deviation turns only by rounding."""

    diverged_deviation: float = setting(1e6, "length scales of the motion")
    """Deviation at which a run ends as diverged. A smaller one would end runs that come back."""


@dataclass(frozen=True)
class RoomSettings(Settings):
    """Settings of the room for results, and of repeated runs."""

    first_turning_points: int = setting(512, "")
    """Turning points stored for a run at first; runs with more are repeated with more room."""

    most_turning_points: int = setting(1 << 20, "")
    """Most turning points of a run, limited by memory."""

    repeated_budget_factor: float = setting(2, "")
    """Factor on the step budget of a run that is repeated because it used up its budget. With a smaller one, runs are
    repeated too often."""

    driven_steps_per_sample: int = setting(200, "")
    """Steps that a run along a log may take per sample on average. A run that needs more chatters."""

    driven_samples: float = setting(4e6, "samples")
    """Samples of all runs along logs that are computed at once, limited by memory."""

    driven_runs: tuple[int, int] = setting((16, 256), "")
    """Fewest and most runs along logs that are computed at once."""

    samples_by_default: int = setting(20_000, "")
    """Sampling intervals of a run for which no sample time is given: enough to see each peak of a swing."""

    most_samples: int = setting(20_000_000, "")
    """Most sampling intervals of a run, whose states and outputs take a few gigabytes."""


@dataclass(frozen=True)
class WorkSettings(Settings):
    """Settings of the counting of work, which is equal on every machine."""

    batch_work: float = setting(1e5, "")
    """Work to prepare a batch of runs, which Python does."""

    counted_lanes: int = setting(8, "")
    """Runs that count as computed side by side, whatever the processor. A processor with fewer lanes takes longer, but
    stops at equal work."""

    fair_share_factor: float = setting(2.0, "of an equal part")
    """Largest part of the remaining work for each of several runs. With less, the longest run stops early."""


@dataclass(frozen=True)
class BuildSettings(Settings):
    """Settings of the building of machine code, and of its cache."""

    waiting_interval: float = setting(0.1, "s")
    """Time between checks whether a result is still needed: shorter than a person notices."""

    priority_time: float = setting(0.5, "s")
    """Longest time for which a question has priority. After that, nobody is still watching, and the compilation of its
    kernel must not keep others waiting."""

    builder_garbage_thresholds: tuple[int, int, int] = setting((100_000, 50, 100), "")
    """Thresholds of the garbage collector of a builder. With the usual ones collection takes a tenth of the time."""

    kept_time: float = setting(60 * 86_400.0, "s")
    """Time after which unused code is deleted."""

    kept_size: int = setting(200_000_000, "bytes")
    """Size of the cache beyond which code is deleted that was not used within a day."""


step_settings = StepSettings.live()
room_settings = RoomSettings.live()
work_settings = WorkSettings.live()
build_settings = BuildSettings.live()
