"""What the edge of hunting is made of: the laws that are fitted to the sweeps.

Rigid (or locked). Two times add up. At the Stribeck velocity the bristles need F_s/(sigma_0 v_s) to slip; and where
friction falls with speed, it drives a mass away with the time constant m v_s/(F_s - F_c). A loop that is faster than
both together catches the mass before it has broken away for good.

Free joint. The stage on its joint may move without the cart, so that the loop corrects it while the bearing sticks.
The slower the joint, sqrt(k_j/m), the lower the edge; but once the deflection has used up the stroke the joint is as
good as locked, and the edge no lower than that of a joint whose stroke just suffices, sqrt(F_s/(m S_j)).
"""

from __future__ import annotations

from functools import partial

from friso.studies.guideline.laws import Law, Rate, beside_locked, in_series

_TUNING = ("alpha", "beta", "tuned_mass")
_FRICTION = ("gap", "bristle_damping", "viscous")
_JOINT = ("stage_share", "joint_damping", "limiter_damping", "stribeck")

SLIP = Rate("slip", {"stribeck": 1.0, "gap": 1.0}, (*_TUNING, *_FRICTION))
"""sigma_0 v_s/F_s"""

DROP = Rate("drop", {"stribeck": -1.0}, (*_TUNING, *_FRICTION))
"""(F_s - F_c)/(m v_s)"""

JOINT = Rate("joint", {"joint": 0.5}, (*_TUNING, *_FRICTION, *_JOINT))
"""sqrt(k_j/m)"""

STROKE = Rate("stroke", {"joint": 0.5, "stroke": -0.5}, (*_TUNING, *_FRICTION, *_JOINT))
"""sqrt(F_s/(m S_j))"""

LOCKED_LAW = Law((SLIP, DROP), partial(in_series, 1.0))
FREE_LAW = Law((JOINT, STROKE), beside_locked)
