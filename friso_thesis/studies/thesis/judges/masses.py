"""Judge Fig. 15: masses and friction forces of the isolated rig."""

from __future__ import annotations

import numpy as np

from friso.quantities import percent
from friso_thesis.studies.thesis.claims import Evidence, Finding, Part, judges
from friso_thesis.studies.thesis.maps import overlap, verdict_table
from friso_thesis.studies.thesis.reading import reading
from friso_thesis.studies.thesis.studies import STUDIES


@judges("F15A", figure="15A", needs=("isolator-masses",))
def mass_ratio_hardly_matters(evidence: Evidence) -> Finding:
    """Judge whether nearly all pairs of masses behave as the thesis's evaluation point does."""
    words = reading()
    cart, stage, moving, valid = verdict_table(evidence.maps["isolator-masses"], "masses.cart", "masses.stage")
    marker = STUDIES["isolator-masses"].marker
    row = int(np.argmin(np.abs(cart - marker["masses.cart"])))
    column = int(np.argmin(np.abs(stage - marker["masses.stage"])))
    other = moving != moving[row, column]
    ratio = cart[:, None] / stage[None, :]
    text = f"{percent(overlap(other, valid), 3)} of {valid.sum()} cells differ from the marker's; "
    text += f"cart-to-stage mass ratio {ratio.min():.2g} to {ratio.max():.2g}"
    if (other & valid).any():
        text += f"; the others at {ratio[other & valid].min():.2g} to {ratio[other & valid].max():.2g}"
    return Finding(
        (
            Part(
                f"the marker's masses come to rest, and few cells (at most {percent(words.few)}) keep moving",
                bool(not moving[row, column] and overlap(other, valid) <= words.few),
                text,
            ),
        )
    )


@judges("F15B", figure="15B", needs=("isolator-friction", "friction"))
def friction_does_not_bring_it_back(evidence: Evidence) -> Finding:
    """Judge whether the isolated rig comes to rest for nearly all pairs of friction forces."""
    words = reading()
    axes = ("friction.static", "friction.coulomb")
    runs = evidence.maps["isolator-friction"]
    static, coulomb, moving, valid = verdict_table(runs, *axes)
    _, _, locked, _ = verdict_table(evidence.maps["friction"], *axes)
    back = moving & valid
    where = ""
    if back.any():
        s, c = static[np.nonzero(back)[0]], coulomb[np.nonzero(back)[1]]
        lasting = int((runs["lasts"].transpose(*axes).values & back).sum())
        where = f"Runs keep moving at F_s {s.min():.2g} to {s.max():.2g} N with F_c {c.min():.2g} to {c.max():.2g} N."
        if lasting < back.sum():
            where += f" Of these {back.sum()} runs {lasting} still swing at their end, the others are long transients."
    return Finding(
        (
            Part(
                "with the isolator the stage comes to rest for all valid pairs of friction forces but a few (at most "
                f"{percent(words.few)})",
                overlap(back, valid) <= words.few,
                f"{back.sum()} of {valid.sum()} cells keep moving; of the {locked.sum()} that do with the joint locked "
                f"{percent(overlap(moving, locked), 3)}",
                where,
            ),
        )
    )
