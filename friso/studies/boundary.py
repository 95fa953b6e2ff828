"""Compute the boundary of hunting over ranges given by a user."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from friso.engine.kernel import KernelRequest, kernels
from friso.engine.tolerance import checked_rtol
from friso.equations.bandwidth import range_example
from friso.errors import InputError
from friso.hunting import CYCLE_RTOL, DITHERS, Diagram, KeyRange, Plane, Space, cannot_hunt, diagram, plane
from friso.progress import Progress, silent
from friso.stage import Stage, violations
from friso.studies.axes import SweptAxis, read_axis
from friso.studies.cells import flat_cells
from friso.studies.links import check_links, names
from friso.studies.settings import settings


def boundary(
    stage: Stage,
    axes: Mapping[str, str],
    links: Mapping[str, str] | None = None,
    rtol: float = CYCLE_RTOL,
    log: bool = False,
    begins: Callable[[], None] = lambda: None,
    progress: Progress = silent,
) -> Diagram | Plane:
    """Return where the hunting cycle of a stage loses stability, over one key or two.

    `axes` are keys with their ranges, ``{"joint.stroke": "0.1 mm..2 mm"}``. A range is logarithmic with ":log" behind
    it, or with `log`. `links` are SI expressions for keys that follow, as in `friso.sweep`. With one axis the result is
    a `Diagram`: all branches of cycles over the range, with their flips, folds and tori. With two it is a `Plane`: the
    curves on which flips, folds and tori lie. The motion of the stage file plays no part.

    `begins` is called once the input has been checked, and `progress` while cycles are followed. Raises InputError for
    a wrong range, link, tolerance or stage (one that cannot hunt).
    """
    checked_rtol(rtol)
    followers, example = dict(links or {}), range_example(stage.flat())
    ranges = tuple(_range(stage, name, text, names(followers), log) for name, text in axes.items())
    if len(ranges) not in (1, 2):
        raise InputError("axes", f"{len(ranges)} keys", "one key or two", example)
    check_links(stage, followers, frozenset(swept.key for swept in ranges))
    if reason := cannot_hunt(stage):
        if reason == DITHERS:
            raise InputError("controller", reason, "a controller without dither", example)
        raise InputError("stage", f"one that cannot hunt: {reason}", "friction and integral action", example)
    for swept in ranges:
        if swept.key.startswith("motion."):
            problem = "a key of the motion, which plays no part"
            raise InputError(swept.key, problem, "a key of the stage or its controller", example)
    if rtol > settings.loosest_rtol:
        raise InputError(
            "rtol", f"{rtol:g}", f"at most {settings.loosest_rtol:g}, since multipliers are derivatives", "1e-9"
        )
    space = Space(ranges, lambda values: flat_cells(stage, followers, values))
    _refuse_impossible(space, example)
    kernels([KernelRequest(space.form, variational) for variational in (False, True)])
    begins()
    return (diagram if len(ranges) == 1 else plane)(space, rtol, progress=progress)


def _refuse_impossible(space: Space, example: str) -> None:
    """Raise InputError if no stage in the ranges is valid, from a coarse grid of stages."""
    points = space.grid(settings.tried_values)
    if not space.allowed(points).any():
        key, why = space.ranges[0].key, violations(space.flat(space.values(points)))[0][1]
        raise InputError(key, "ranges that no stage may have", why, example)


def _range(stage: Stage, name: str, text: str, free: frozenset[str], log: bool) -> KeyRange:
    """Read the text of a range, such as "0.1 mm..2 mm", for the boundary of hunting.

    `name` is a key of the stage, or with `free` a variable that links use. Raises InputError for a range with a number
    of points, or with ends that the key may not have.
    """
    read, example = read_axis(stage, name, text, name in free, log), range_example(stage.flat())
    if isinstance(read, SweptAxis) or read.count is not None:
        raise InputError(
            name, repr(text), "a range FIRST..LAST, without a number of points", range_example(stage.flat())
        )
    field = stage.numeric_keys().get(name)
    if field is not None and not (field.bound.holds(read.first) and field.bound.holds(read.last)):
        raise InputError(name, repr(text), f"values {field.bound.text}", example)
    return KeyRange(name, read.first, read.last, read.scale == "log", read.unit)
