"""Settings of closed orbits: how limit cycles are guessed, closed, and distinguished."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class OrbitSettings(Settings):
    """Settings of orbits: guesses of cycles, Newton's method, and multipliers."""

    frictionless_size: float = setting(1e-6, "m")
    """Size of the motion of a stage without friction. It is linear, so any size will do."""

    least_asymmetry_share: float = setting(0.05, "")
    """Smallest asymmetry of a guess of an asymmetric cycle. With less, the guess leads to the symmetric cycle."""

    least_lean_share: float = setting(1e-3, "of the amplitude")
    """Smallest offset of the middle of an asymmetric cycle. With less, the orbit is the symmetric one."""

    guess_variants: tuple[tuple[float, float], ...] = setting(
        ((1.0, 1.0), (0.985, 1.05), (0.985, 1.0), (0.97, 1.05), (1.015, 1.0)), ""
    )
    """Factors on the guessed distance and time, tried in turn. More variants close hardly any further orbit."""

    kept_distance_share: float = setting(0.5, "")
    """Largest distance of an orbit from its guess. Farther off it is another solution, such as rest."""

    guess_returns: int = setting(40, "returns")
    """Returns that are simulated to find an attractor where no orbit closes near a guess."""

    steady_return_share: float = setting(0.02, "")
    """Largest change of the last returns of a simulation that has reached a cycle."""

    refined_distances: int = setting(8, "")
    """Distances on which a fixed point of the map is narrowed down before Newton's method begins."""

    unwinding_wait_share: float = setting(0.4, "waits")
    """Time from a stop until the actuator only balances constant forces, as a fraction of the wait."""

    almost_return_log: float = setting(0.03, "")
    """Largest error of a return that serves as the guess of a cycle."""

    beside_cycle_share: float = setting(2e-3, "of the distance")
    """Start of a simulation beside a cycle. Closer to it, rounding decides where the run goes."""

    beside_cycle_returns: int = setting(8, "returns")
    """Returns over which deviations are seen to grow or shrink. More leave the linear range."""

    linear_deviation_share: float = setting(0.02, "of the distance")
    """Largest deviation that grows as the multiplier says."""

    least_friction_fall: float = setting(0.002, "of break-away")
    """Smallest fall of friction with speed for which the search covers all cycles."""

    no_friction_fall: float = setting(1e-9, "of break-away")
    """Fall of friction that is only rounding of the friction curve."""

    least_feeding_ratio: float = setting(0.05, "")
    """Smallest ratio of the fall of friction to amplitude that can feed a cycle. The least found was forty times
    larger."""

    fastest_friction_speed: float = setting(1e7, "speeds of small swings")
    """Highest speed at which friction curves are examined. At higher speeds friction no longer falls."""

    friction_speeds: int = setting(300, "")
    """Speeds at which friction curves are examined: thirty per decade, narrower than any fall of friction."""

    least_certain_swing: float = setting(0.001, "deflections at break-away")
    """Smallest swing that counts as resolved. Runs resolve smaller cycles badly and may miss them."""

    feeding_ratio_range: tuple[float, float] = setting((2.0, 6.0), "")
    """Least and largest ratio of the fall of friction over the speeds of a cycle to its amplitude."""

    wide_dead_zone: float = setting(2.0, "deflections at break-away")
    """Width of a dead zone beyond which most starts of a survey lie within it, where nothing winds up."""

    friction_stages_at_once: int = setting(64, "")
    """Stages whose friction curves are examined at once. More take too much memory."""

    trace_samples: int = setting(2000, "")
    """Samples of a drawn period. With fewer, curves have corners where a stage breaks away."""

    slope_range_share: float = setting(0.01, "of the distance")
    """Range of the return map's slope where a limiter chatters. Over a smaller one the slope follows the chatter."""

    slope_runs: int = setting(25, "")
    """Runs through which the slope is fitted. Fewer follow the scatter of returns."""

    least_slope_runs: int = setting(18, "")
    """Fewest returning runs for the slope of a return map. With fewer, the range crosses a break of the map."""

    near_return_share: float = setting(0.25, "of the range")
    """Largest distance of a return from the others. Farther off it belongs to another branch of the map."""

    leak_time_constants: float = setting(10.0, "time constants")
    """Time after which the integrator of a stuck stage is 5e-5 off its final value."""

    map_points: int = setting(32, "")
    """Points of a return map before refinement. Fixed points closer than a step are missed."""

    map_range: tuple[float, float] = setting((0.02, 2.0), "deflections at break-away")
    """Range of a return map. From nearer a stage creeps home; from farther off it does not stick."""

    breakaway_waits: float = setting(2.0, "waits")
    """Longest wait for break-away. A stage that takes longer creeps home."""

    flight_time: float = setting(60.0, "1/natural frequencies")
    """Longest crossing of a stage to the other side. One that takes longer creeps."""

    newton_steps: int = setting(40, "")
    """Most Newton steps. Orbits that need more do not close."""

    fresh_jacobian_gap: float = setting(1e-5, "of the states")
    """Gap beyond which an old Jacobian misleads Newton's method."""

    old_jacobian_share: float = setting(0.1, "")
    """Least reduction of the gap per step that keeps an old Jacobian in use."""

    stalled_steps: tuple[int, int, int] = setting((3, 8, 1), "")
    """Steps in which the gap must halve, or the search ends: far from an orbit, near it, and once closed."""

    newton_stride: float = setting(0.3, "")
    """Longest Newton step, relative to the states. Longer ones leave the range of convergence."""

    followed_stalled_steps: tuple[int, int, int] = setting((3, 3, 1), "")
    """Steps in which the gap must halve along a branch, where the next orbit is near."""

    place_nudge: float = setting(1e-6, "")
    """Change of place for a numerical derivative. If smaller it is rounding; if larger it includes curvature."""

    place_nudge_chattering: float = setting(1e-5, "")
    """Change of place for a numerical derivative where a limiter chatters, which moves the end of a run."""

    condition_gap_share: float = setting(1e-3, "")
    """Gap per error of a condition on orbits. With more, the scatter of multipliers keeps Newton's method from ending;
    with less, it ends too early."""

    branch_nudges: tuple[float, float] = setting((1e-6, 1e-4), "")
    """Smallest and largest relative change of an orbit along its branch for a numerical derivative of the multiplier. A
    smaller one is rounding; a larger one includes curvature."""

    swing_leg_share: float = setting(0.5, "of the distance")
    """Smallest leg of the zigzag that counts as a swing. Smaller legs are ringing of a stage that sticks."""


settings = OrbitSettings.live()
