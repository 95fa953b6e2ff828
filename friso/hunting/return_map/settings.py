"""Settings of return maps: how they are sampled, refined, and read."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class ReturnMapSettings(Settings):
    """Settings of return maps, which predict the next sticking distance from the present one.

    A landing is where a stage sticks after a swing.
    """

    maps_decide: bool = setting(True, "")
    """Whether maps decide what attracts a stage. Without them every stage is searched from many starts: a comparison
    shows whether maps are right."""

    near_starts: tuple[tuple[float, float, int], ...] = setting(
        ((0.001, 0.007, 4), (0.01, 3.0, 24)), "deflections at break-away"
    )
    """Starts near the reference: first, last and number of each range. More are added where the map needs them."""

    far_starts: tuple[float, float, int] = setting((5.0, 300.0, 6), "deflections at break-away")
    """Starts from which a stage passes its reference without sticking at first. The runs come to lie on the map
    later."""

    limited_starts: tuple[float, float, int] = setting((600.0, 30000.0, 6), "deflections at break-away")
    """Farther starts with a force limit, which lets a stage swing as far as it moves the masses."""

    sketched_starts: tuple[tuple[float, float, int], ...] = setting(
        ((0.003, 0.003, 1), (0.02, 3.0, 14)), "deflections at break-away"
    )
    """Starts near the reference for a sketch. With fewer, hunting from a usual range of distances is missed."""

    break_shares: tuple[float, ...] = setting((0.2, 0.4, 0.6, 0.8), "of the way between two starts")
    """Places at which more runs begin, to narrow down a break of the map. More run at once for nothing."""

    hardly_attracting_share: float = setting(0.95, "")
    """Largest fraction of a deviation left per repetition at which a sketched attractor is trusted. Above it, 51 of 149
    sketched attractors did not attract."""

    least_arriving_points: int = setting(4, "")
    """Fewest points of a map that must lead to an attractor. Fewer come from gaps of the map."""

    attractor_tries: int = setting(4, "")
    """Tries to close an attractor. Each adds landings where the map predicts them; after four the map does not
    change."""

    followed_repetitions: int = setting(3, "")
    """Repetitions for which a run must follow an attractor of the map before an orbit is closed from it."""

    simple_closing_share: float = setting(0.05, "")
    """Largest difference between landings of the simplest cycles from which an orbit can be closed."""

    closing_share: float = setting(0.01, "")
    """Largest difference between landings of longer cycles, which need better guesses, for an orbit to be closed."""

    same_orbit_distance_share: float = setting(0.05, "")
    """Largest difference in mean distance between an orbit and the attractor of the map."""

    map_scatter_share: float = setting(0.05, "")
    """Largest scatter of landings about the prediction of their neighbours. With more, the stage remembers more than
    distance."""

    first_landings: int = setting(3, "landings")
    """Landings after which a stage has forgotten how its motion began."""

    more_landings: int = setting(3, "landings")
    """Landings added at a time to runs that the map does not decide yet."""

    fate_rounds: int = setting(8, "")
    """Rounds after which a run that the map does not decide stays unknown."""

    unsure_landing_share: float = setting(0.02, "")
    """Error of a landing beyond which the stage still remembers its start."""

    break_jump_log: float = setting(0.5, "")
    """Difference in log distance beyond which neighbouring returns lie on two sides of a break of the map."""

    break_steepness: float = setting(3.0, "")
    """Slope between two points beyond which the map breaks off."""

    sure_errors: float = setting(3.0, "standard errors")
    """Errors of a slope by which a cycle must be unstable to be told so for sure."""

    merged_range_log: float = setting(0.02, "")
    """Range of log distance in which landings count as one point. The slope between nearer ones is noise."""

    fitted_reaches_log: tuple[float, ...] = setting((0.15, 0.075, 0.0375), "")
    """Ranges of log distance on either side within which a cubic is fitted. A map bends little over a seventh; beside a
    corner only the narrowest fits."""

    fewest_fitted: int = setting(7, "landings")
    """Fewest landings to which a cubic is fitted, three more than it has coefficients. They form more points than it
    has coefficients, too."""

    fitted_scatter_log: float = setting(0.01, "")
    """Scatter of landings about a fitted cubic beyond which the map goes through the landings themselves."""

    quick_iterations: tuple[int, ...] = setting((8, 24), "landings")
    """Iterations of the map, in rounds, in which most starts reach an attractor."""

    map_iterations: tuple[int, ...] = setting((100, 200, 400), "landings")
    """Iterations, in further rounds, for starts that leave a cycle slowly. One that strays no more after a round than
    after the one before is irregular."""

    move_on_landings: int = setting(4, "landings")
    """Landings after which distances that hardly change are moved on."""

    most_passed_landings: int = setting(40, "landings")
    """Most landings that are passed over at once. Over more, the slope of the map changes."""

    slow_move_log: float = setting(1e-3, "")
    """Change of log distance over two landings below which it hardly changes."""

    repeated_share: float = setting(1e-9, "")
    """Largest error of a repetition that is exact. Beside a break of the map a landing differs by more."""

    arrived_share: float = setting(1e-6, "")
    """Change of landings below which they have reached a cycle."""

    same_landing_share: float = setting(2e-3, "")
    """Difference beyond which landings one cycle apart count as different."""

    same_attractor_share: float = setting(0.02, "")
    """Largest difference between landings of one attractor reached from two starts."""

    farthest_sticking: float = setting(3.0, "deflections at break-away")
    """Farthest distance of sticking. From farther off a stage passes its reference without sticking."""

    scatter_range_log: float = setting(0.05, "")
    """Distance between points over which scatter is measured. Over more, the map itself changes."""

    ringing_share: float = setting(0.05, "of the distance")
    """Largest ringing of a stage that has landed."""

    standing_speed: float = setting(1e-3, "distances times natural frequency")
    """Speed below which a stage has landed."""

    resting_move_share: float = setting(0.01, "of the distance")
    """Largest move of a stage that rests or creeps home while it could have broken away."""

    round_step_limit: int = setting(20_000, "steps")
    """Most steps of a round. A swing takes a thousand; a limiter that chatters would take millions."""

    flight_time: float = setting(30.0, "1/natural frequencies")
    """Longest crossing in a round. A slower one continues in the next round."""

    extra_rounds: int = setting(10, "")
    """Further rounds for a stage that stops short, creeps, or is driven at its force limit."""

    run_landings: int = setting(3, "landings")
    """Landings of a run. From the first one on, they no longer depend on the start."""

    coarse_gap_log: float = setting(0.15, "")
    """Widest gap between points away from the diagonal. Wider ones hide folds of the map."""

    fine_gap_log: float = setting(0.03, "")
    """Widest gap between points near the diagonal, where the map decides stability. Finer gaps take more runs."""

    diagonal_gain_log: float = setting(0.1, "")
    """Range about the diagonal in which gaps must be fine: swings grow or shrink by less than a tenth."""

    outermost_loss_log: float = setting(0.3, "")
    """Loss of the outermost points beyond which the map leads inward, so that no attractor lies farther out."""

    break_width_log: float = setting(0.02, "")
    """Width to which a break between two starts is narrowed down."""

    runs_added: int = setting(12, "")
    """Most runs added at once for one stage, because all other stages wait for them."""

    refining_rounds: int = setting(2, "")
    """Rounds of refinement. Further rounds change the map only where a search decides in any case."""


settings = ReturnMapSettings.live()
