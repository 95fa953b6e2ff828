"""Tuning numbers of `friso.remedies`, with the reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class RemedySettings(Settings):
    """Settings of the search for what stops the hunting."""

    unchanged_share: float = setting(1e-6, "")
    """Numbers that differ by less were rounded, not changed."""

    factor_beyond: float = setting(4.0, "")
    """Keys may go further than in the first settings; less misses smaller changes of other keys."""

    factor_away: float = setting(2.0, "")
    """Keys may go the other way too, by less: that is rarely a smaller change."""

    other_settings: int = setting(24, "")
    """Settings that break no constraint are looked at from the least change on; more of them cost moves."""

    values_alone: int = setting(24, "")
    """Fewer overshoot the least change of a single key; each value costs a move of all machines."""

    finer_values: int = setting(8, "")
    """Halves the least change three times more; finer is below the spread of machines."""

    change_parts: tuple[float, ...] = setting((0.15, 0.3, 0.5, 0.7), "")
    """Where between the least change and the settings that work others are tried."""

    machine_factor: int = setting(2, "")
    """The least change is at the edge of what works: with the usual number of machines it often fails."""

    smallest_move: float = setting(10.0, "")
    """In tolerances: the smallest move without [moves]; shorter ones are hardly left by a stage that is in position."""

    large_share: float = setting(4.0, "")
    """Ratio of largest to smallest move from which settings are told that serve large moves alone; with less of the
    range there is hardly a stroke that they serve."""

    most_tries: int = setting(3, "")
    """Remedies whose three best points fail on fresh machines have not worked at all."""

    most_looks: int = setting(12, "")
    """Points looked at on fresh machines; more take minutes and have found nothing better."""

    bandwidths_beside: int = setting(2, "")
    """Bandwidths on either side at which a tuned stage is judged, down to the distance wanted from hunting and as far
    up: with two they are 1.095 apart, nearer than the steps of a search for an edge; with fewer a window of hunting
    slips through, more cost as much each as the stage's own."""

    confirming_work: float = setting(4e8, "")
    """About 5 s on one core to search what attracts a tuned stage, and as much to judge it and what attracts it beside
    its bandwidth; most take a tenth. Beyond it the stage is not sure to work."""

    present_check_work: float = setting(3e8, "")
    """About 4 s on one core to check the stage as it is, of which the words and the keys that matter for the edge of
    hunting are told; with less, more stages have no edge located."""

    verifying_work: float = setting(1.2e9, "")
    """About 15 s on one core; beyond it no other point of the remedy is verified."""

    progress_steps: int = setting(20, "")
    """Verifying a point takes about as long as so many generations, for the progress that is shown."""

    setting_pairs: int = setting(2, "")
    """Settings against friction tried together with the bandwidth; more take minutes."""

    fresh_seed: int = setting(1000, "")
    """Machines that the optimiser has not seen, among which its best points are chosen."""

    unseen_seed: int = setting(2000, "")
    """Machines on which what was chosen is measured, so that the share is not that of its own choice."""

    further_seed: int = setting(4000, "")
    """Machines that are added where the first are too few to decide."""

    usual_seed: int = setting(3000, "")
    """Machines that tell how robust such machines usually are."""

    usual_machines: int = setting(200, "")
    """Fewer leave the usual modulus margin uncertain in its second digit."""

    far_margin_share: float = setting(0.5, "")
    """A machine with less than half the margin of others is told of: it would be retuned."""

    few_share: float = setting(0.2, "")
    """A few, as a share of the machines that may miss the goal."""

    relaxing_work: float = setting(8e8, "")
    """About 10 s on one core to find what serves large moves alone and which part of the goal to relax; machines with
    elements of friction took five times as long, to find nothing."""

    relaxed_points: int = setting(3, "")
    """More points for one relaxation take minutes."""

    relaxed_machines: int = setting(8, "")
    """As many as in the search, so that both judge alike."""

    reasonable_factor: float = setting(3.0, "")
    """Nobody relaxes a goal by more without changing the machine."""

    wider_tolerances: tuple[float, ...] = setting((1.5, 2.0, 3.0, 5.0), "")
    """Factors of the tolerance that are proposed; the least that does is the answer."""

    most_relaxed: int = setting(64, "")
    """Points tried with wider tolerances, the quickest to settle first; more take minutes."""

    optimiser_seed: int = setting(27, "")
    """Any number does; a fixed one gives equal answers for equal input."""

    worst_time: float = setting(1e3, "s")
    """Longer than any move: a point that breaks a constraint is worse than any that does not."""

    survey_parts: int = setting(4, "")
    """The first of so many parts of the fresh machines is surveyed before the others: it tells of most settings that
    fail, at a quarter of the cost; with more parts it tells of fewer."""

    further_parts: tuple[float, ...] = setting((1 / 12, 1 / 3), "")
    """Shares of the further machines after which it is looked whether they decide. With more looks fewer machines are
    measured, but more settings pass by chance: with these, one in forty of those that are right for just the share
    wanted, of whom two more looks would let one in thirty pass."""

    survey_batch: int = setting(3, "")
    """Points whose machines are surveyed at once: fewer leave cores idle, more are surveyed in vain."""

    most_batches: int = setting(8, "")
    """A remedy all of whose points have attractors by then does not work."""

    generation_points: int = setting(40, "")
    """Larger generations of the optimiser cost more moves and converge no better."""

    tuning_work: float = setting(1.5e9, "")
    """About 18 s on one core for all remedies of the controller but the first, and as much for those that buy a joint;
    remedies left then are not tried, which the answer says. With more, machines whose motions are long take minutes."""

    search_work: float = setting(4e8, "")
    """About 5 s on one core; moves that chatter take most of it. Less ends a search of four keys early."""

    looking_work: float = setting(4.0, "")
    """In units of the work of a search: looking at points on fresh machines, and at what attracts these."""

    setting_work_share: float = setting(1 / 3, "")
    """Most runs of a setting that does not work go on to the end: they are ended sooner."""

    far_above_limit: float = setting(1.5, "")
    """Above so many times the limit of the bandwidth a point is penalised as far above."""

    near_ranges: tuple[float, ...] = setting((0.12, 0.12, 0.03), "")
    """Shares of the ranges in which the search goes on about its best point, one after the other."""

    hopeless_generations: int = setting(4, "")
    """Generations after which a search may be hopeless; fewer end one whose first points lie badly."""

    hopeless_nearness: float = setting(0.5, "")
    """Share of machines that settle with the best point below which a search is hopeless: more generations rarely bring
    the others to rest, and runs that do not settle cost most."""

    hopeful_nearness: float = setting(0.9, "")
    """Share of machines that settle with the best point from which on a search goes on around it; below it, none of the
    axes of the benchmark found a setting there."""

    agreed_cost: float = setting(0.01, "")
    """Generations whose costs agree this closely move no more."""

    bandwidth_reserve: float = setting(1e-3, "")
    """Bandwidths are rounded and taken from a grid: without a reserve they exceed their limit."""

    apart_share: float = setting(0.03, "")
    """Nearer points share the attractor of their neighbour: surveying them is in vain."""

    alike_share: float = setting(0.01, "")
    """Nearer points are the same settings to a drive."""

    first_machines: int = setting(3, "")
    """Three machines refuse most points that do not work, at a tenth of the cost."""

    points_looked_at: int = setting(12, "")
    """So many points on fresh machines fill the lanes; more wait for the slowest."""

    points_around: int = setting(64, "")
    """Points drawn around one beyond the edge of what works; fewer miss the way back."""

    around_share: float = setting(0.02, "")
    """Share of the ranges within which they are drawn first."""

    most_closer: int = setting(4, "")
    """How often that is halved; nearer points are the same settings."""

    widened_factor: float = setting(1.5, "")
    """After a batch with attractors the next points are so much farther away."""

    loop_change: float = setting(1e-5, "")
    """The loop at one frequency is smooth: smaller changes drown in rounding."""

    smooth_share: float = setting(1e-2, "")
    """A settling time that moves otherwise than its derivative says jumps: it has none."""

    suggested_strokes: tuple[float, ...] = setting((1e-4, 3e-4, 1e-3, 3e-3), "m")
    """The shortest that does is the answer; longer ones are no joint of leaf springs."""

    suggested_force: float = setting(0.6, "")
    """Above it the cart moves before the joint touches its limiter on weak machines."""

    move_rtol: float = setting(1e-6, "")
    """Settling times that are told are then exact in three digits."""

    looser_tolerance: float = setting(10.0, "")
    """Ten times the tolerance shows what a looser one would bring."""

    gain_factor: float = setting(4.0, "")
    """Gains further apart have the form of another controller."""

    fastest_factor: float = setting(10.0, "")
    """A bandwidth beyond it is limited by the drive on every machine here."""

    slowest_factor: float = setting(0.3, "")
    """A slower loop no longer settles within the move."""

    joint_force_share: tuple[float, float] = setting((0.2, 0.8), "")
    """Above it the cart moves before the joint touches its limiter; below it the joint hardly guides."""

    joint_strokes: tuple[float, float] = setting((1e-5, 3e-3), "m")
    """Shorter joints isolate nothing, longer ones are no leaf springs."""

    snap_share: float = setting(0.02, "")
    """A number that hardly differs from the present one is left as it is."""

    rounded_share: float = setting(2e-3, "")
    """Tuned numbers are rounded: margin and bandwidth may be off by this share."""

    window_points: int = setting(16, "")
    """Fewer step over a narrow window in which the remedy works."""

    window_halvings: int = setting(4, "")
    """Locates an end to a sixteenth of a step; finer is below the spread of machines."""

    surveyed_halvings: int = setting(2, "")
    """Halvings of the range in which a window ends because something attracts machines: each costs surveys of all."""

    worthwhile_share: float = setting(0.85, "")
    """A change counts as smaller than another if its logarithm is below this share of the other's: to verify one that
    is hardly smaller costs seconds and brings nothing."""
