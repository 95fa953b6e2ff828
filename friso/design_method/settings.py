"""Settings of `friso.design_method`, with a reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class DesignSettings(Settings):
    """Settings of the design of leaf springs, joint and controller."""

    size_step: float = setting(1e-4, "m")
    """Step of sizes that a workshop makes."""

    confirmed_candidates: int = setting(24, "")
    """Candidates of the front confirmed by the beam model, which takes a second for each."""

    enough_margin: float = setting(0.95, "")
    """Fraction of the best modulus margin beyond which more damping is not worth its trouble."""

    edge_bisections: int = setting(3, "")
    """Bisections that locate an edge to 1 or 2 %. Each takes a search for orbits."""

    orbit_rtol: float = setting(1e-7, "")
    """Tolerance of orbits. Multipliers are needed to a percent."""

    front_population: int = setting(160, "")
    """Population of the search for the front. A smaller one leaves gaps."""

    front_generations: int = setting(120, "")
    """Generations of the search for the front. Fewer have not converged with many requirements."""

    start_generations: int = setting(60, "")
    """Generations in which a geometry that meets all requirements is found, if there is one."""

    front_seed: int = setting(34, "")
    """Seed of the front. A fixed one gives equal fronts for equal specifications."""

    map_crossovers: int = setting(24, "")
    """Crossovers of the map. Fewer show steps in the edge; each is a search of a cell."""

    map_strokes: int = setting(16, "")
    """Strokes of the map. Fewer show steps in the edge; each is a search of a cell."""

    map_reach: tuple[tuple[float, ...], ...] = setting(((1 / 30, 2.0), (1 / 30, 3.0)), "")
    """Range of the map relative to the design. It shows both edges of hunting of the thesis's rig."""

    stage_mass_share: float = setting(0.3, "")
    """Fraction of the mass on the joint if the stage file has one mass. The thesis's rig has 0.29."""

    first_force_share: float = setting(0.5, "")
    """Force at the stroke over static friction from which a search starts. At 1 the cart moves before the joint."""

    first_damping: float = setting(0.05, "")
    """Damping ratio from which a search starts, that of leaf springs with a little grease."""

    stop_stiffness: float = setting(0.1, "")
    """Stiffness of the stop over Young's modulus times the stroke. The thesis's limiter has 0.105."""

    stop_damping: float = setting(0.016, "")
    """Damping ratio of the stop, that of the thesis's limiter with its stage."""

    leaves_seed: int = setting(36, "")
    """Seed of the search for leaves. A fixed one gives equal leaves for equal joints."""

    leaves_generations: int = setting(60, "")
    """Generations of the search for leaves. Fewer have not converged."""

    leaves_points: int = setting(20, "")
    """Points for each of the three variables of a search for leaves. Fewer stay at the first thickness."""

    highest_mode: float = setting(1e6, "Hz")
    """Frequency of leaves without a mode that both actuator and sensor see."""

    worst_cost: float = setting(1e3, "")
    """Cost above that of any leaves that meet the requirements."""

    width_steps: int = setting(5, "")
    """Steps that adapt the width to the stiffness, to within a percent under any load."""

    stiffness_error: float = setting(0.01, "")
    """Relative error of the stiffness allowed for whole sizes."""

    tried_strokes: int = setting(4, "")
    """Strokes tried over a range in the specification. Each takes a design."""

    present_share: float = setting(1e-3, "")
    """Relative difference of a limit from the present crossover up to which it is that crossover, rounded in a
    template."""

    lowest_edge: float = setting(1 / 40, "")
    """Lowest crossover of the search, over the machine's limit. Slower loops hunt with any joint."""

    highest_edge: float = setting(3.0, "")
    """Highest crossover of the search, over the machine's limit. Faster loops are unstable."""

    edge_steps: int = setting(24, "")
    """Crossovers of the search for an edge. Fewer step over a narrow range of hunting."""

    above_crossover: float = setting(2.0, "")
    """Factor on the chosen crossover above which an edge does not matter."""

    slow_share: float = setting(0.05, "")
    """Fraction of the moves that may take longer than specified. Less would need ten times the moves."""

    design_rounds: int = setting(12, "")
    """Most rounds of adapting leaves and crossover to each other."""

    lower_crossover: float = setting(0.97, "")
    """Factor by which the crossover is lowered in a round. Smaller steps need more rounds; larger ones waste crossover.
    """

    accepted_crossover: float = setting(0.98, "")
    """Fraction of the possible crossover that is enough; softer leaves are then preferred."""

    friction_spread: float = setting(0.3, "")
    """Relative spread of friction, as in catalogues of bearings of one type."""

    mass_spread: float = setting(0.05, "")
    """Relative spread of masses, that of usual payloads."""

    shortest_move: float = setting(0.1, "")
    """Shortest move over the longest."""

    corner_levels: tuple[float, ...] = setting((0.0, 0.5, 1.0), "")
    """Places in the ranges of static friction and gap. The middle counts too, because hunting is not monotonous in
    both."""

    population_seed: int = setting(6, "")
    """Seed of the machines. A fixed one draws equal machines for equal specifications."""

    return_after: float = setting(5.0, "s")
    """Time of the return, as in the thesis's path."""

    relaxed_beyond: float = setting(3.0, "")
    """Factor by which space and sheets may exceed the specification in a proposal."""

    relaxed_population: int = setting(16, "")
    """Population of the search for relaxations. A smaller one misses a requirement that alone stands in the way."""

    relaxed_generations: int = setting(80, "")
    """Generations of the search for relaxations. Fewer have not converged."""

    relaxed_seed: int = setting(5, "")
    """Seed of the search for relaxations. A fixed one gives equal proposals for equal specifications."""

    unmet_penalty: float = setting(10.0, "")
    """Penalty of unmet requirements, the logarithm of a factor beyond all relaxation."""

    relaxed_reserve: float = setting(0.01, "")
    """Reserve of other requirements in a relaxation, because sizes are made in whole steps."""

    relaxed_more: float = setting(1.03, "")
    """Factor on a relaxed requirement, because sizes are made in whole steps."""

    model_reserve: float = setting(1.015, "")
    """Reserve for the error of closed forms (docs/evidence/flexure.md), so that the beam model confirms the result."""

    verified_moves: int = setting(10_000, "")
    """Number of verified moves, which shows 95 % to half a percent."""

    compared_moves: int = setting(1000, "")
    """Number of these moves that are also made with the joint locked, which shows a fraction to three percent of all.
    Where the joint is needed many of them swing, and are followed ten times as long."""

    followed_time: float = setting(15.0, "s")
    """Time for which a move is followed, as in the thesis's path."""

    longer_factor: float = setting(10.0, "")
    """Factor on that time for machines not in position by then: they creep or hunt."""

    last_share: float = setting(0.25, "")
    """Final part of the run in which a stage must stay in its window, longer than the slowest period of hunting seen.
    """

    verified_rtol: float = setting(1e-5, "")
    """Tolerance of the moves, which gives settling times to a few percent."""

    runs_per_report: int = setting(512, "")
    """Runs between progress reports, about a second."""


settings = DesignSettings.live()
