"""Fig. 15: masses and friction forces of the isolated rig."""

from __future__ import annotations

import numpy as np

from friso.studies.thesis.claims import FEW, Evidence, Finding, Part, judges
from friso.studies.thesis.maps import share, table
from friso.studies.thesis.studies import STUDIES


@judges("F15A", figure="15A", needs=("isolator-masses",))
def mass_ratio_hardly_matters(evidence: Evidence) -> Finding:
    """Cells that are otherwise than the marker."""
    cart, stage, hunts, valid = table(evidence.maps["isolator-masses"], "masses.cart", "masses.stage")
    marker = STUDIES["isolator-masses"].marker
    row = int(np.argmin(np.abs(cart - marker["masses.cart"])))
    column = int(np.argmin(np.abs(stage - marker["masses.stage"])))
    other = hunts != hunts[row, column]
    ratio = cart[:, None] / stage[None, :]
    text = f"{share(other, valid):.1%} of {valid.sum()} cells differ from the marker's; "
    text += f"cart-to-stage mass ratio {ratio.min():.2g} to {ratio.max():.2g}"
    if (other & valid).any():
        text += f"; the others at {ratio[other & valid].min():.2g} to {ratio[other & valid].max():.2g}"
    return Finding(
        (
            Part(
                f"no peaks are counted at the marker's masses, and in few cells (at most {FEW:.0%})",
                bool(not hunts[row, column] and share(other, valid) <= FEW),
                text,
            ),
        )
    )


@judges("F15B", figure="15B", needs=("isolator-friction", "friction"))
def friction_does_not_bring_it_back(evidence: Evidence) -> Finding:
    """Cells that hunt with the isolator, and the behaviour of those that hunt with the joint locked."""
    axes = ("friction.static", "friction.coulomb")
    static, coulomb, hunts, valid = table(evidence.maps["isolator-friction"], *axes)
    _, _, locked, _ = table(evidence.maps["friction"], *axes)
    back = hunts & valid
    where = ""
    if back.any():
        s, c = static[np.nonzero(back)[0]], coulomb[np.nonzero(back)[1]]
        where = f"hunting stays at F_s {s.min():.2g} to {s.max():.2g} N with F_c {c.min():.2g} to {c.max():.2g} N"
    return Finding(
        (
            Part(
                "no valid pair of friction forces hunts with the isolator",
                not back.any(),
                f"{back.sum()} of {valid.sum()} cells hunt; of the {locked.sum()} that hunt with the joint locked "
                f"{share(hunts, locked):.1%}",
                where,
            ),
        )
    )
