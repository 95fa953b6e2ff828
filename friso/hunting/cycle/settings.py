"""Settings of closed orbits: how cycles are guessed, closed, and told from each other."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class OrbitSettings(Settings):
    """Settings of orbits: guesses of cycles, Newton's method that closes them, and multipliers."""

    frictionless_size: float = setting(1e-6, "m")
    """A stage without friction is linear, so any size of the motion will do."""

    least_asymmetry_share: float = setting(0.05, "")
    """Guesses that lean by less lead to the symmetric cycle."""

    least_lean_share: float = setting(1e-3, "of the amplitude")
    """An orbit that leans by less is the symmetric one."""

    guess_variants: tuple[tuple[float, float], ...] = setting(
        ((1.0, 1.0), (0.985, 1.05), (0.985, 1.0), (0.97, 1.05), (1.015, 1.0)), ""
    )
    """Factors on the guessed distance and time, tried in turn: more variants close hardly any further orbit."""

    kept_distance_share: float = setting(0.5, "")
    """An orbit farther from its guess is another one, such as the rest that every stage has."""

    guess_returns: int = setting(40, "returns")
    """Returns that are simulated to find an attractor where no orbit closes near a guess."""

    steady_return_share: float = setting(0.02, "")
    """A simulation whose returns still change by more has not come to a cycle."""

    refined_distances: int = setting(8, "")
    """More distances bracket a fixed point of the map closer than Newton's method needs."""

    unwinding_wait_share: float = setting(0.4, "waits")
    """Time from landing until the actuator only balances constant forces, as a share of the wait."""

    almost_return_log: float = setting(0.03, "")
    """Returns that miss by more are no guesses of a cycle."""

    held_range_share: float = setting(0.06, "of the distance")
    """Lasting motions beside an unstable cycle lie within this range."""

    held_runs: int = setting(61, "")
    """Ranges narrower than a step between runs are missed; more runs take longer."""

    held_break_runs: int = setting(12, "")
    """An attractor beside a break of the map may be as narrow as a step between runs."""

    held_returns: int = setting(3, "returns")
    """The map is then also known at the distances to which it leads."""

    nearest_start_share: float = setting(1e-3, "of the distance")
    """Closer to a cycle, rounding decides where a run goes."""

    held_map_steps: int = setting(500, "")
    """Slow motions beside a cycle need hundreds of returns, which the map gives at once."""

    held_starts: int = setting(12, "")
    """More starts than these repeat much the same motions."""

    beside_cycle_share: float = setting(2e-3, "of the distance")
    """Start of a simulation beside a cycle: closer, rounding decides where it goes."""

    beside_cycle_returns: int = setting(8, "returns")
    """Enough to see whether deviations grow; more leave the range that is linear."""

    linear_deviation_share: float = setting(0.02, "of the distance")
    """Larger deviations do not grow as the multiplier says."""

    least_friction_fall: float = setting(0.002, "of break-away")
    """With less fall of friction, cycles are smaller than the search covers."""

    no_friction_fall: float = setting(1e-9, "of break-away")
    """A fall below it is rounding of the friction curve."""

    least_feeding_ratio: float = setting(0.05, "")
    """The least fall over amplitude with which a cycle was found was forty times as much."""

    fastest_friction_speed: float = setting(1e7, "speeds of small swings")
    """Beyond this speed friction curves no longer fall."""

    friction_speeds: int = setting(300, "")
    """Thirty per decade: a fall of friction is broader."""

    least_certain_swing: float = setting(0.001, "deflections at break-away")
    """Smaller cycles may be missed: runs resolve them badly."""

    feeding_ratio_range: tuple[float, float] = setting((2.0, 6.0), "")
    """Least and largest ratio of the fall of friction over the speeds of a cycle to its amplitude."""

    wide_dead_zone: float = setting(2.0, "deflections at break-away")
    """Most starts of a survey lie within a wider one, where nothing winds up."""

    friction_stages_at_once: int = setting(64, "")
    """Hundreds of speeds each: more stages at once take too much memory."""

    trace_samples: int = setting(2000, "")
    """Samples of a period that are drawn: fewer show corners where a stage breaks away."""

    slope_range_share: float = setting(0.01, "of the distance")
    """Range of the slope where a limiter chatters: over less, the slope follows the chatter."""

    slope_runs: int = setting(41, "")
    """A line through fewer returns follows their scatter."""

    least_slope_runs: int = setting(30, "")
    """If fewer runs come back, the range reaches beyond a break of the map."""

    near_return_share: float = setting(0.25, "of the range")
    """Returns farther off the others belong to another branch of the map."""

    leak_time_constants: float = setting(10.0, "time constants")
    """By then the integrator of a stuck stage is 5e-5 off its end."""

    map_points: int = setting(32, "")
    """Fixed points closer than a step are missed; the map is refined where it turns."""

    map_range: tuple[float, float] = setting((0.02, 2.0), "deflections at break-away")
    """Smaller swings creep home; from farther off, a stage does not stick."""

    breakaway_waits: float = setting(2.0, "waits")
    """A stage that takes longer to break away creeps home."""

    flight_time: float = setting(60.0, "1/natural frequencies")
    """A way across that takes longer is creeping."""

    newton_steps: int = setting(40, "")
    """Orbits that need more steps do not close."""

    fresh_jacobian_gap: float = setting(1e-5, "of the states")
    """Farther from an orbit, an old Jacobian misleads Newton's method."""

    old_jacobian_share: float = setting(0.1, "")
    """An old Jacobian is kept while each step shrinks the gap at least to this share."""

    stalled_steps: tuple[int, int, int] = setting((3, 8, 1), "")
    """Steps in which the gap must halve, far from an orbit, near it and closed; otherwise the search ends."""

    newton_stride: float = setting(0.3, "")
    """Longer steps leave the range in which Newton's method converges to this orbit."""

    followed_stalled_steps: tuple[int, int, int] = setting((3, 3, 1), "")
    """Steps in which the gap must halve along a branch: the next orbit is near, and closes soon or not at all."""

    place_nudge: float = setting(1e-5, "")
    """A smaller change of place is rounding; a larger one suffers from curvature."""

    swing_leg_share: float = setting(0.5, "of the distance")
    """Smaller legs are ringing of a stage that has landed."""
