"""Tuning numbers of `friso.design_method`, with the reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class DesignSettings(Settings):
    """Settings of the design of leaf springs, joint and controller."""

    size_step: float = setting(1e-4, "m")
    """Sizes that a workshop makes without asking."""

    confirmed_candidates: int = setting(24, "")
    """Each takes a second of the beam model; the front has no more that differ visibly."""

    enough_margin: float = setting(0.95, "")
    """More damping than gives this share of the best modulus margin is not worth its trouble."""

    edge_bisections: int = setting(3, "")
    """Locates an edge to 1 or 2 %; each takes a search for orbits."""

    orbit_rtol: float = setting(1e-7, "")
    """Multipliers are needed to a percent; looser orbits give them to ten."""

    front_population: int = setting(160, "")
    """Smaller populations leave gaps in the front."""

    front_generations: int = setting(120, "")
    """Fewer have not converged for specifications with many requirements."""

    start_generations: int = setting(60, "")
    """A geometry that meets all requirements is found by then, or there is none."""

    front_seed: int = setting(34, "")
    """Any number does; a fixed one gives equal fronts for equal specifications."""

    map_crossovers: int = setting(24, "")
    """Fewer show steps in the edge; each is a search of a cell."""

    map_strokes: int = setting(16, "")
    """Fewer show steps in the edge; each is a search of a cell."""

    map_reach: tuple[tuple[float, ...], ...] = setting(((1 / 30, 2.0), (1 / 30, 3.0)), "")
    """In units of the design: shows both edges of hunting of the thesis's rig."""

    stage_mass_share: float = setting(0.3, "")
    """The thesis's rig has 0.29; used where the stage file does not tell."""

    first_force_share: float = setting(0.5, "")
    """A search begins in the middle of what works: at 1 the cart moves before the joint."""

    first_damping: float = setting(0.05, "")
    """A search begins with the damping that leaf springs have with a little grease."""

    stop_stiffness: float = setting(0.1, "")
    """Over Young's modulus times the stroke; of the thesis's limiter it is 0.105."""

    stop_damping: float = setting(0.016, "")
    """Damping ratio of the stop; the thesis's limiter has it with its stage."""

    leaves_seed: int = setting(36, "")
    """Any number does; a fixed one gives equal leaves for equal joints."""

    leaves_generations: int = setting(60, "")
    """Fewer have not converged; the search takes a second."""

    leaves_points: int = setting(20, "")
    """For each of three variables; fewer are caught in the first thickness."""

    highest_mode: float = setting(1e6, "Hz")
    """Stands for leaves none of whose modes actuator and sensor both see."""

    worst_cost: float = setting(1e3, "")
    """Above the cost of any leaves that meet the requirements."""

    width_steps: int = setting(5, "")
    """The stiffness rises nearly as the width: five steps reach a percent under any load."""

    stiffness_error: float = setting(0.01, "")
    """Whole sizes come no closer."""

    tried_strokes: int = setting(4, "")
    """Where the specification leaves a range; each takes a design."""

    lowest_edge: float = setting(1 / 40, "")
    """In units of the machine's limit: slower loops hunt whatever the joint."""

    highest_edge: float = setting(3.0, "")
    """In units of the machine's limit: faster loops are unstable."""

    edge_steps: int = setting(24, "")
    """Fewer step over a narrow range of hunting; each is a search of a cell."""

    above_crossover: float = setting(2.0, "")
    """In units of the crossover chosen: an edge beyond it does not matter."""

    slow_share: float = setting(0.05, "")
    """Share of the moves that may take longer than specified; less would need ten times the moves."""

    design_rounds: int = setting(12, "")
    """Leaves and crossover that do not agree by then go round in circles."""

    lower_crossover: float = setting(0.97, "")
    """Smaller steps need more rounds, larger ones give crossover away."""

    accepted_crossover: float = setting(0.98, "")
    """Softer leaves for the last two percent of crossover are not worth it."""

    friction_spread: float = setting(0.3, "")
    """What catalogues give for bearings of one type."""

    mass_spread: float = setting(0.05, "")
    """What payloads usually differ by."""

    shortest_move: float = setting(0.1, "")
    """Shorter moves are no longer moves of this stage."""

    corner_levels: tuple[float, ...] = setting((0.0, 0.5, 1.0), "")
    """Hunting is not monotonous in static friction and gap: the middle counts too."""

    population_seed: int = setting(6, "")
    """Any number does; a fixed one draws equal machines for equal specifications."""

    return_after: float = setting(5.0, "s")
    """As in the thesis's path: a stage that hunts has shown it by then."""

    relaxed_beyond: float = setting(3.0, "")
    """Space and sheets further beyond the specification are another design."""

    relaxed_population: int = setting(16, "")
    """Smaller populations miss the requirement that stands alone in the way."""

    relaxed_generations: int = setting(80, "")
    """Fewer have not converged; the search takes a second."""

    relaxed_seed: int = setting(5, "")
    """Any number does; a fixed one gives equal proposals for equal specifications."""

    unmet_penalty: float = setting(10.0, "")
    """The logarithm of a factor beyond all relaxation."""

    relaxed_reserve: float = setting(0.01, "")
    """Sizes are made in whole steps: without a reserve the others are missed."""

    relaxed_more: float = setting(1.03, "")
    """More is asked of what is relaxed, for the same reason."""

    model_reserve: float = setting(1.015, "")
    """Closed forms may be off by so much (docs/evidence/flexure.md): the beam model confirms what keeps it."""

    verified_moves: int = setting(10_000, "")
    """Shows a share of 95 % to half a percent."""

    followed_time: float = setting(15.0, "s")
    """As in the thesis's path: a stage that hunts has shown it by then."""

    longer_factor: float = setting(10.0, "")
    """Machines not in position by then are followed so much longer: they creep or hunt."""

    last_share: float = setting(0.25, "")
    """Longer than the period of the slowest hunting that was seen."""

    verified_rtol: float = setting(1e-5, "")
    """Tells whether a machine settles and when, to a few percent; tighter runs take longer."""

    runs_per_report: int = setting(512, "")
    """Progress is told every second or so."""
