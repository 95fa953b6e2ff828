"""Settings of `friso.remedies`, with a reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class RemedySettings(Settings):
    """Settings of the search for remedies against hunting."""

    unchanged_share: float = setting(1e-6, "")
    """Largest relative difference between numbers that is rounding, not a change."""

    factors_tried: int = setting(24, "")
    """Factors on the bandwidth tried either way. Fewer overshoot the smallest change; each costs a move of all
    machines."""

    fastest_unasked: float = setting(4.0, "")
    """Largest factor on the controller's speed that is advised where nobody stated modes or a limit of the machine."""

    faster_than_least: float = setting(1.3, "")
    """Factor above the least speed that works up to which other remedies are searched, unless a limit of the bandwidth
    is stated. Within it they cost the machine about as much as the least one."""

    mode_share: float = setting(0.5, "")
    """Largest bandwidth advised unasked, over the frequency of the lowest mode. Above it a mode that the file has
    wrong by a little takes the margin, with or without a notch."""

    sampling_share: float = setting(0.1, "")
    """Largest bandwidth advised unasked, over the sampling rate. Above it the phase that sampling costs depends on when
    the drive reads and writes, which files seldom tell."""

    described_remedies: int = setting(2, "")
    """Remedies that are described in full, the cheapest first. More are a catalogue; the table has all."""

    typed_digits: int = setting(4, "")
    """Significant digits of tuned numbers, in the units of the file. Fewer cost margin by rounding."""

    listed_changes: int = setting(6, "")
    """Largest number of changed keys that a row of the table lists; the stage file of the remedy has the others."""

    machine_factor: int = setting(2, "")
    """Factor on the number of machines drawn for searches, so that others stand in for those that are left out."""

    smallest_move: float = setting(10.0, "")
    """Smallest move without [moves], in tolerances. A stage in position hardly leaves its place for shorter ones."""

    most_tries: int = setting(3, "")
    """Best points of a remedy that are verified. If all fail on fresh machines, it does not work."""

    most_looks: int = setting(12, "")
    """Points inspected on fresh machines. More take minutes and have not led to better ones."""

    bandwidths_beside: int = setting(2, "")
    """Bandwidths on either side at which a tuned stage is judged, from the required distance below to as far above.
    With two they are 1.095 apart, closer than the steps of a search for an edge. Fewer may miss a window; each costs as
    much as the stage's own."""

    confirming_work: float = setting(4e8, "")
    """Work to confirm a tuned stage, about 5 s on one core, and as much for nearby bandwidths. Most stages take a tenth
    of it; a stage that takes more is not sure to work."""

    present_check_work: float = setting(3e8, "")
    """Work to check the present stage, about 4 s on one core. With less, more stages have no edge located."""

    verifying_work: float = setting(1.2e9, "")
    """Work to verify a remedy, about 15 s on one core. Once it is exceeded, no other point is verified."""

    progress_steps: int = setting(20, "")
    """Progress steps of a verification, which takes as long as this many generations."""

    setting_pairs: int = setting(2, "")
    """Settings against friction that are combined with the bandwidth. More take minutes."""

    fresh_seed: int = setting(1000, "")
    """Seed of the fresh machines on which the best points are chosen."""

    unseen_seed: int = setting(2000, "")
    """Seed of the unseen machines on which the chosen settings are measured."""

    further_seed: int = setting(4000, "")
    """Seed of machines that are added if the first are too few to decide."""

    usual_seed: int = setting(3000, "")
    """Seed of machines that show the usual robustness."""

    usual_machines: int = setting(200, "")
    """Machines that show the usual modulus margin. Fewer leave its second digit uncertain."""

    far_margin_share: float = setting(0.5, "")
    """Fraction of the usual margin below which a machine is left out of the few on which settings are tried."""

    few_share: float = setting(0.2, "")
    """Fraction, of the machines that may miss the goal, whose margins lie below what is usual."""

    optimiser_seed: int = setting(27, "")
    """Seed of the optimiser. A fixed one gives equal answers for equal input."""

    worst_time: float = setting(1e3, "s")
    """Settling time that ranks a point that breaks a constraint behind all others, longer than any move."""

    survey_parts: int = setting(4, "")
    """Parts of the fresh machines, of which the first is surveyed before the others. It reveals most failing settings
    at a quarter of the cost."""

    further_parts: tuple[float, ...] = setting((1 / 12, 1 / 3), "")
    """Fractions of the further machines after which the interval is examined. With more examinations, more settings
    pass by chance: with these two, one in forty of the settings with exactly the required fraction; with two more, one
    in thirty."""

    survey_batch: int = setting(3, "")
    """Points whose machines are surveyed at once. Fewer leave cores idle; more are surveyed in vain."""

    most_batches: int = setting(8, "")
    """Batches of surveyed points after which a remedy whose machines all hunt does not work."""

    generation_points: int = setting(40, "")
    """Points of a generation of the optimiser. More cost moves and converge no better."""

    tuning_work: float = setting(1.5e9, "")
    """Work for all remedies of the controller but the first, about 18 s on one core, and as much for remedies that buy
    a joint. Remedies left then are not tried, and the answer says so."""

    alternatives_share: float = setting(0.5, "")
    """Fraction of generations and work of other searches once the speed of the controller works and no limit of it is
    stated. They find alternatives near that speed, which need not be the very best."""

    others_time: float = setting(36.0, "s")
    """Time for which other remedies are tried once one works, as is said then: twice `tuning_work`, on one core."""

    search_work: float = setting(4e8, "")
    """Work for a search, about 5 s on one core. Less ends a search of four keys early."""

    looking_work: float = setting(4.0, "")
    """Work to inspect points on fresh machines, in units of the work of a search."""

    setting_work_share: float = setting(1 / 3, "")
    """Fraction of the work of a search for one setting, because runs of a setting that fails go on to the end."""

    far_above_limit: float = setting(1.5, "")
    """Factor above the limit of the bandwidth beyond which a point is penalised as far above."""

    near_ranges: tuple[float, ...] = setting((0.12, 0.12, 0.03), "")
    """Widths of the ranges, relative to the whole range, in which the search continues around its best point, in
    turn."""

    hopeless_generations: int = setting(4, "")
    """Generations after which a search may be abandoned. Fewer would end a search whose first points lie badly."""

    hopeless_nearness: float = setting(0.5, "")
    """Fraction of machines that settle with the best point below which a search is abandoned."""

    hopeful_nearness: float = setting(0.9, "")
    """Fraction of machines that settle with the best point from which the search continues around it."""

    agreed_cost: float = setting(0.01, "")
    """Relative difference of costs at which generations have converged."""

    bandwidth_reserve: float = setting(1e-3, "")
    """Distance of bandwidths from their limit, below it, to allow for rounding."""

    apart_share: float = setting(0.03, "")
    """Smallest distance between surveyed points, over the ranges. Nearer ones hunt if their neighbour does."""

    alike_share: float = setting(0.01, "")
    """Distance within which points are the same settings for a drive, over the ranges."""

    first_machines: int = setting(3, "")
    """Machines tried first. Three of them reject most failing points at a tenth of the cost."""

    points_looked_at: int = setting(12, "")
    """Points tried together on fresh machines, enough to fill the lanes."""

    points_around: int = setting(64, "")
    """Points drawn around a point beyond the limit of what works. Fewer miss the way back."""

    around_share: float = setting(0.02, "")
    """Half-width of the first range in which points are drawn around another, over the ranges."""

    most_closer: int = setting(4, "")
    """Halvings of that range. Nearer points are practically equal settings."""

    widened_factor: float = setting(1.5, "")
    """Factor on the distance of the next points after a batch with hunting."""

    suggested_strokes: tuple[float, ...] = setting((1e-4, 3e-4, 1e-3, 3e-3), "m")
    """Strokes tried for a suggested joint, the shortest first. Longer ones are not leaf springs."""

    suggested_force: float = setting(0.6, "")
    """Force of a suggested joint at its stroke, over static friction. With more, the cart of weak machines moves first.
    """

    move_rtol: float = setting(1e-6, "")
    """Tolerance of reported moves. Their settling times are then accurate to three digits."""

    looser_tolerance: float = setting(10.0, "")
    """Factor of a looser tolerance, which shows how near machines are to settling."""

    gain_factor: float = setting(4.0, "")
    """Factor by which relative gains vary either way."""

    fastest_factor: float = setting(10.0, "")
    """Largest factor of the bandwidth. Beyond it the drive limits every machine."""

    slowest_factor: float = setting(0.3, "")
    """Smallest factor of the bandwidth. A slower loop does not settle within the move."""

    joint_force_share: tuple[float, float] = setting((0.2, 0.8), "")
    """Least and largest force of a joint at its stroke, over static friction. With more the cart moves first; with less
    the joint hardly guides."""

    joint_strokes: tuple[float, float] = setting((1e-5, 3e-3), "m")
    """Shortest and longest stroke of a joint. Shorter ones isolate nothing; longer ones are not leaf springs."""

    snap_share: float = setting(0.02, "")
    """Relative difference from the present number below which the present number is kept."""

    rounded_share: float = setting(2e-3, "")
    """Largest relative error of margin and bandwidth by rounding of tuned numbers."""


settings = RemedySettings.live()
