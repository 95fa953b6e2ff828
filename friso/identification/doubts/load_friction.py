"""Friction that grows with the force of the motor, as that of worm gears, belts and preloaded screws does."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from friso.identification.doubt import Doubt, FitCase, RaisedDoubt
from friso.identification.doubts.changing_friction import changing_forces
from friso.identification.doubts.coupling import coupling_force
from friso.identification.doubts.delay import delay_force
from friso.identification.output_error.effects import explained_by_forces, reaching_over
from friso.identification.output_error.parameters import is_free
from friso.identification.settings import DoubtSettings
from friso.quantities import percent


def find(case: FitCase) -> Iterator[RaisedDoubt]:
    """Fit a force against the motion in proportion to the motor's force, beside the friction of the model.

    Such friction makes a mass seem heavier while the motor drives it than while the motor brakes it. The model has one
    mass and one Coulomb friction for both: of 3 kg and 5 N with a tenth of the force they came out at 3.13 to 3.36 kg
    and 5.44 to 5.60 N, without a doubt. It is named where it explains much of what the fit leaves, and more than a
    coupling, a delay, or friction that changes with time would.
    """
    fit, settings, step = case.fit, DoubtSettings.current(), case.log.sample_time
    names = [parameter.name for parameter in fit.problem.parameters]
    quality = case.quality
    if quality.failed or quality.rejected or case.has_cause or is_free(case.flat) or "friction.coulomb" not in names:
        return
    top = settings.speed_share_of_creeping * np.abs(case.velocity).max()
    against = -np.abs(case.log["force"][case.log.longest]) * np.clip(case.velocity / top, -1.0, 1.0)
    explained = explained_by_forces(fit, [against], [settings.share_of_a_tried_load])
    if explained is None or explained.left > settings.power_left_by_a_load:
        return
    share, coupled = float(explained.sizes[0]), coupling_force(case)
    rivals = [([delay_force(case)], [settings.samples_of_a_tried_delay * step])]
    rivals += [([coupled], [settings.mass_share_of_a_tried_coupling])] if coupled is not None else []
    rivals.append(changing_forces(fit, case.velocity)[:2])
    others = [explained_by_forces(fit, *rival) for rival in rivals]
    least, most = settings.shares_of_a_load
    if not least <= share <= most or any(other.left < explained.left for other in others if other):
        return
    words = (
        f"Friction grows with the force of the motor, by {percent(share)} of it, as that of worm gears, belts and "
        "preloaded screws does: no friction of the stage file does so, and the intervals allow for it; constant speeds "
        "with and without a load would show it"
    )
    wider = reaching_over(fit, settings.reach_of_a_load * np.abs(explained.moved))
    yield RaisedDoubt(words, share, fit=wider, explains=True)


DOUBT = Doubt(
    "fit",
    find,
    "a force against the motion in proportion to the motor's force",
    "intervals widen; a coupling and a delay are not named beside it",
    "constant speeds with and without a load",
    after=("friction-by-direction",),
)
