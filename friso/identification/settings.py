"""Settings of identification: of the doubts about logs of moves."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class DoubtSettings(Settings):
    """When a doubt is raised, and how far its consequences reach."""

    error_share_of_a_cause: float = setting(
        0.7,
        "",
        "A cause counts if the model without it has at most this share of the error; nearer 1, chance finds some.",
    )
    error_ratio_of_rival_causes: float = setting(
        1.5,
        "",
        "Causes count beside the best up to this ratio of errors: they cannot be told apart; larger names many.",
    )
    motion_periods_of_a_shift: float = setting(
        0.25,
        "",
        "Longest shift of the force searched, in periods of the motion's bandwidth; beyond it a sign would turn.",
    )
    motion_periods_of_an_average: float = setting(
        1.0, "", "Longest average searched, in periods of the motion's bandwidth; longer ones leave no motion."
    )
    places_of_a_force: int = setting(
        40, "", "Places along the way with a force of their own; fewer miss cogging, more take longer."
    )
    rows_for_each_place: int = setting(
        20, "", "Rows of the inverse model for each such place at least; with fewer a place fits noise."
    )
    samples_of_a_reference: int = setting(
        20, "", "Samples of a segment at least for the motion of its reference; the filter needs as many."
    )
    speed_share_of_a_fast_stage: float = setting(
        0.1,
        "",
        "From this share of the highest speed a missing feedforward has to show. Of 400 drawn logs of the whole force, "
        "one was said to lack a feedforward, 98 where all speeds counted; of 186 that lacked one, 130 were, and 174.",
    )
    power_share_of_an_oscillation: float = setting(
        0.5,
        "",
        "Share of the residual's power in one peak that counts as an oscillation; less is in any coloured noise.",
    )
    samples_of_a_spectrum: int = setting(
        256, "", "Samples of each piece of the residual for its spectrum: longer ones resolve more and scatter more."
    )
    share_of_a_whole_record: float = setting(
        0.2, "", "Share of a record in its longest stretch up to which gaps are told: little is then fitted."
    )
    digits_of_a_fine_position: float = setting(
        500.0, "", "Steps of the position's digits over the travel from which on they are fine enough not to be told."
    )
    force_share_of_a_constant_force: float = setting(
        0.1,
        "",
        "Share of the force's standard deviation that a constant force exceeds to be told, beside the friction.",
    )
    force_share_of_no_friction: float = setting(
        1e-3, "", "Share of the force's standard deviation below which Coulomb friction is that of no bearing."
    )
    deviations_of_differing_halves: float = setting(
        3.29, "", "Deviations by which the halves of a record differ by chance once in a thousand times."
    )
    noise_ratio_of_a_lacking_model: float = setting(
        10.0, "", "A fit that leaves so many times the noise lacks something; smaller doubts what friction is to LuGre."
    )
    error_of_a_poor_model: float = setting(
        0.3, "", "Relative error of the force from which on a model does not describe the record."
    )
    error_of_an_unsettled_record: float = setting(
        0.1, "", "Share of the force that a fit and the best cause may both leave; beyond it, intervals widen."
    )
    error_share_of_a_clearly_better_model: float = setting(
        0.5, "", "A whole model below this share of the error without a cause needs no cause."
    )
    error_ratio_of_a_contradiction: float = setting(
        1.5,
        "",
        "A whole model whose steady friction leaves so many times the inverse model's error contradicts the log.",
    )
    error_of_a_fine_model: float = setting(
        0.01,
        "",
        "Relative error of the force below which a whole model contradicts nothing, whatever the inverse leaves.",
    )
    widening_where_much_is_left: float = setting(
        2.0,
        "",
        "Intervals are so many times as wide where much is left that nothing explains, and those of slow friction "
        "where anything is: without, of known machines with a filtered signal, a reference for a position, "
        "intervals missed the truth by up to 1.8 half-widths.",
    )
    sample_share_of_a_direction: float = setting(
        0.2, "", "Share of the counted samples in a direction at least for a fit of its own; fewer show too little."
    )
    cost_share_of_either_direction: float = setting(
        0.5, "", "Share of the squares that fits to either direction leave at most where friction differs: our choice."
    )
    bandwidths_of_a_coupling: float = setting(
        2.0,
        "",
        "Cut-off of the motion in bandwidths, well below the coupling, whose swinging no derivative describes. Of 3 kg "
        "with a third behind 40 Hz, a mass 1.3 % too large becomes right at 2 and 3, and by half at 5.",
    )
    mass_share_of_a_tried_coupling: float = setting(
        0.05,
        "",
        "Share of the inertia by which the force is changed for its effect: larger ones are out of proportion.",
    )
    reach_of_a_coupling: float = setting(
        2.0,
        "",
        "Intervals reach so many times as far as a coupling moves the fit: one linear step recovered no more than 60 % "
        "of 1.5 % by which the mass of a machine on a coupling was off.",
    )
    mass_share_of_a_coupling: float = setting(
        0.003, "", "Share of the mass by which a coupling moves it to be told; less is within good sensors' errors."
    )
    bandwidths_of_a_delayed_force: float = setting(
        10.0, "", "Cut-off of the force in bandwidths of the motion, above which its derivative is noise."
    )
    samples_of_a_tried_delay: float = setting(
        0.05, "", "Samples by which the force is moved for its effect: larger ones are followed in jumps."
    )
    reach_of_a_delay: float = setting(
        2.0,
        "",
        "Intervals reach so many times as far as a delay moves the fit: one linear step recovered 40 to 50 % (in the "
        "logarithm) of the damping of bristles that three samples more than doubled.",
    )
    samples_of_a_delay: float = setting(
        0.25, "", "Samples of delay from which on it is told; shorter ones are within the hold of the force."
    )
    speed_share_of_creeping: float = setting(
        0.01, "", "Share of the highest speed up to which friction is not counted as that of one direction."
    )
    friction_share_of_a_tried_force: float = setting(
        0.05, "", "Share of Coulomb friction by which the force is changed for its effect on the record."
    )
    friction_share_of_a_change: float = setting(
        0.1, "", "Share of Coulomb friction by which something has to change to be told."
    )
    fewest_break_aways: int = setting(3, "", "Break-aways at least that contradict a fit; fewer may be chance.")
    speeds_of_a_start: int = setting(
        50, "", "Speeds at which the curve of a fit is looked at, up to that of a body that has begun to move."
    )
    stribeck_velocities_of_sliding: float = setting(
        2.0, "", "At so many Stribeck velocities 2 % of the effect is left, by the exponent 2; less would be friction."
    )
