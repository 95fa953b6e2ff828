"""Declare the compliant joint between cart and stage, with its limiter (thesis, Fig. 3).

Table 1 of the thesis prints a series formula for the touched limiter. A touching limiter acts in parallel with the leaf
springs, so stiffness and damping are added here.
"""

from __future__ import annotations

import sympy as sp

from friso.equations.component import Component, Kink, Output, key
from friso.equations.masses import beyond_stops, deflection_under, stops
from friso.equations.structure import JointForm


def joint_force(form: JointForm, deflection: sp.Expr, rate: sp.Expr, limiter_pulls: bool) -> tuple[sp.Expr, Component]:
    """Return the force of the joint on the cart [N], and its kinks, for a deflection [m].

    Kinks are where derivatives jump. "locked": cart and stage are coupled by the limiter alone. "touching": the stroke
    is zero, so that the limiter always touches. "free": the limiter touches where abs(deflection) exceeds the stroke. A
    limiter that cannot pull lets go where its damping would outweigh its stiffness. `rate` [m/s] is that of the
    deflection.
    """
    contact = key("joint.limiter_stiffness") * deflection + key("joint.limiter_damping") * rate
    leaves = key("joint.stiffness") * deflection + key("joint.damping") * rate
    kinks: tuple[Kink, ...] = ()
    if form == "locked":
        force = contact
    elif form == "touching":
        force = leaves + contact
    else:
        stroke = key("joint.stroke")
        kinks = touching(deflection)
        reached = key("joint.limiter_stiffness") * stroke
        ahead, behind = (kink.beyond for kink in kinks)
        if not limiter_pulls:
            pushing = stops(contact, reached, "contact")
            ahead, behind = ahead * pushing[0].beyond, behind * pushing[1].beyond
            kinks = (*kinks, *pushing)
        force = leaves + beyond_stops(ahead, behind, contact, reached)
    outputs = {
        "joint_deflection": Output(deflection, "m", "joint deflection"),
        "joint_force": Output(force, "N", "joint force"),
    }
    return force, Component(kinks=kinks, outputs=outputs)


def joint_deflection(form: JointForm, force: sp.Expr) -> sp.Expr:
    """Return the deflection of the joint [m] under a constant force [N], as in `joint_force`."""
    if form == "rigid":
        return sp.S.Zero
    limiter = key("joint.limiter_stiffness")
    if form == "locked":
        return force / limiter
    if form == "touching":
        return force / (key("joint.stiffness") + limiter)
    return deflection_under(force, key("joint.stiffness"), limiter, key("joint.stroke"))


def touching(deflection: sp.Expr) -> tuple[Kink, Kink]:
    """Return the kinks at which the limiter of a free joint touches, ahead and behind.

    At a kink derivatives jump. `deflection` [m] is that of the joint.
    """
    return stops(deflection, key("joint.stroke"), "stroke")
