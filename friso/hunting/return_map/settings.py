"""Settings of return maps: how they are sampled, refined, and read."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class ReturnMapSettings(Settings):
    """Settings of return maps, which predict where a stage sticks next from where it stuck last."""

    hardly_attracting_share: float = setting(0.95, "")
    """With more of a deviation left per repetition, 51 of 149 sketched attractors did not attract."""

    least_arriving_points: int = setting(4, "")
    """Attractors to which fewer points of a map come are artefacts of its gaps."""

    attractor_tries: int = setting(4, "")
    """Each try adds landings where the map leads; after four it does not change."""

    followed_repetitions: int = setting(3, "")
    """Fewer repetitions do not show that an attractor of the map is one of the stage."""

    simple_closing_share: float = setting(0.05, "")
    """Landings of the simplest cycles that differ by less are near enough to close an orbit."""

    closing_share: float = setting(0.01, "")
    """Cycles of several landings need better guesses."""

    same_orbit_distance_share: float = setting(0.05, "")
    """An orbit whose mean distance differs by more is another than that of the map."""

    map_scatter_share: float = setting(0.05, "")
    """Landings that scatter by more about the prediction of their neighbours are no map: the stage remembers more."""

    confirmed_landings: int = setting(12, "landings")
    """A map is confirmed by runs that land this often where it predicts."""

    first_landings: int = setting(3, "landings")
    """After these a stage has forgotten how its motion began."""

    more_landings: int = setting(3, "landings")
    """More at once would be wasted on runs that the map already decides."""

    fate_rounds: int = setting(8, "")
    """A run that the map does not decide by then stays unknown."""

    unsure_landing_share: float = setting(0.02, "")
    """A landing that is off by more shows that the stage still remembers its start."""

    break_jump_log: float = setting(0.5, "")
    """Neighbouring returns that differ by more are on two sides of a break of the map."""

    break_steepness: float = setting(3.0, "")
    """A map that is steeper between two points breaks off there."""

    map_iterations: int = setting(200, "landings")
    """Most starts have reached an attractor by then."""

    iteration_doublings: int = setting(4, "")
    """Maps that still leave a cycle slowly are followed for sixteen times as long."""

    checked_landings: int = setting(10, "landings")
    """A number with many divisors: cycles of 1, 2, 5 and 10 landings are seen."""

    exact_repetition_share: float = setting(1e-9, "")
    """A repetition this close is no slow approach."""

    arrived_share: float = setting(1e-6, "")
    """Landings that change by less have come to a cycle."""

    same_landing_share: float = setting(2e-3, "")
    """Landings a cycle apart that differ by more are different ones."""

    same_attractor_share: float = setting(0.02, "")
    """Landings of one attractor from two starts differ by less."""

    farthest_sticking: float = setting(3.0, "deflections at break-away")
    """From farther off a stage passes its reference without sticking."""

    scatter_range_log: float = setting(0.05, "")
    """Scatter is measured between points within this distance; over more, the map itself changes."""

    ringing_share: float = setting(0.05, "of the distance")
    """A stage that has landed rings by less."""

    standing_speed: float = setting(1e-3, "distances times natural frequency")
    """A slower stage has landed; a faster one is still on its way."""

    resting_move_share: float = setting(0.01, "of the distance")
    """A stage that moves by less while it could have broken away rests or creeps home."""

    round_step_limit: int = setting(20_000, "steps")
    """A swing takes a thousand; a limiter that chatters would take millions."""

    flight_time: float = setting(30.0, "1/natural frequencies")
    """A crossing that takes longer goes on in the next round."""

    extra_rounds: int = setting(10, "")
    """A stage that stops short, creeps, or is driven at its force limit needs several rounds for a swing."""

    run_landings: int = setting(3, "landings")
    """After the first landing, the next ones no longer depend on how the run began."""

    coarse_gap_log: float = setting(0.15, "")
    """Wider gaps between points hide folds of the map."""

    fine_gap_log: float = setting(0.01, "")
    """Near the diagonal the map decides what attracts; finer gaps take more runs."""

    diagonal_gain_log: float = setting(0.1, "")
    """The map is near its diagonal where swings grow or shrink by less than a tenth."""

    outermost_loss_log: float = setting(0.3, "")
    """Outermost points that lose more lead inward, so no attractor lies beyond them."""

    break_width_log: float = setting(0.02, "")
    """Breaks between two starts are narrowed down to this width; no attractor was met in narrower ranges."""

    runs_added: int = setting(12, "")
    """More runs at once for one stage keep all others waiting."""

    refining_rounds: int = setting(2, "")
    """After two rounds the map changes only where a search decides anyway."""
