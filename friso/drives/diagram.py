"""The loop of a controller, drawn in characters, so that nobody has to guess which structure its gains are of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

ABOVE, MAIN, BELOW, LAST, LOWEST = range(5)
"""Lines of a drawing."""

AHEAD = {
    "acceleration_feedforward": "m d²r/dt²",
    "viscous_feedforward": "d dr/dt",
    "coulomb_feedforward": "Fc sign(dr/dt)",
}


class Canvas:
    """Lines of a drawing, each written from left to right."""

    def __init__(self) -> None:
        self.lines = [""] * 5
        self.add("r --(+)-- e --")
        self.put(BELOW, 5, "| -")
        self.put(LAST, 5, "y")

    def add(self, text: str) -> None:
        """Go on along the main line."""
        self.lines[MAIN] += text

    def junction(self) -> int:
        """A sum on the main line; the place of its sign."""
        self.add("--(+)")
        return len(self.lines[MAIN]) - 2

    def put(self, line: int, place: int, text: str) -> None:
        """Write at a place of a line, behind what stands there."""
        self.lines[line] = f"{self.lines[line]:<{place}}{text}"

    def ended(self, key: Mapping[str, Any]) -> str:
        """The drawing, the force behind filters and limit."""
        boxes = [*(["filters"] if _filters(key, "forward") else []), *(["limit"] if "force_limit" in key else [])]
        self.add("--" + "".join(f"[ {name} ]--" for name in boxes) + "> F")
        return "\n".join(line.rstrip() for line in self.lines if line.strip())


def loop_diagram(flat: Mapping[str, Any]) -> str:
    """The loop of a stage given as flat keys, with the terms that it has; empty for a controller from elsewhere."""
    key = {name.removeprefix("controller."): v for name, v in flat.items() if name.startswith("controller.")}
    if key["kind"] == "cascade":
        return _cascade(key)
    if key["kind"] == "pid":
        return _van_dijk(key) if "crossover" in key else _pid(key)
    return ""


def _cascade(key: Mapping[str, Any]) -> str:
    canvas = Canvas()
    canvas.add("[ kv (1 + 1/(Tp s)) ]" if "position_integral_time" in key else "[ kv ]")
    if key["velocity_feedforward"]:
        place = canvas.junction()
        canvas.put(BELOW, place, "|")
        canvas.put(LAST, place - 6, "f dr/dt")
    place = canvas.junction()
    how = ", filtered" if key["velocity_filter"] or _filters(key, "feedback") else ""
    canvas.put(BELOW, place, "| -")
    canvas.put(LAST, place, "|")
    canvas.put(LOWEST, place, f"dy/dt{how}")
    on_error, integral = key["proportional_on"] == "error", "velocity_integral_time" in key
    velocity = "kp (1 + 1/(Tn s))" if integral and on_error else "kp/(Tn s)" if integral else "kp"
    canvas.add(f"--[ {velocity} ]")
    ahead = _ahead(key)
    if ahead or not on_error:
        place = canvas.junction()
        if ahead:
            canvas.put(ABOVE, place, f"v  {ahead}")
        if not on_error:
            canvas.put(BELOW, place, "| -")
            canvas.put(LAST, place, f"kp dy/dt{how}")
    return canvas.ended(key)


def _pid(key: Mapping[str, Any]) -> str:
    canvas = Canvas()
    derivative = "kd s/(1 + tau s)" if key["tau"] else "kd s"
    on_error = key["derivative_on"] == "error"
    terms = ["kp", *(["ki/s"] if key["ki"] else []), *([derivative] if key["kd"] and on_error else [])]
    canvas.add(f"[ {' + '.join(terms)} ]")
    ahead, beside = _ahead(key), key["kd"] and not on_error
    if ahead or beside:
        place = canvas.junction()
        if ahead:
            canvas.put(ABOVE, place, f"v  {ahead}")
        if beside:
            canvas.put(BELOW, place, "| -")
            canvas.put(LAST, place, f"[ {derivative} ]-- y")
    return canvas.ended(key)


def _van_dijk(key: Mapping[str, Any]) -> str:
    canvas = Canvas()
    canvas.add("[ 1/(1 + tau_p s) ]--[ k_p (1 + tau_z s)(1 + 1/(tau_i s)) ]")
    return canvas.ended(key)


def _ahead(key: Mapping[str, Any]) -> str:
    """What is fed forward to the force."""
    return " + ".join(term for name, term in AHEAD.items() if key.get(name))


def _filters(key: Mapping[str, Any], path: str) -> bool:
    """Whether there are filters in a path."""
    return any(name.startswith("filters.") and name.endswith(".path") and key[name] == path for name in key)
