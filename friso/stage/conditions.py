"""The table [conditions]: how the guide runs, against when its [friction] was measured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

from friso.quantities import Bound, Number, Quantity, Value, any_sign, non_negative, positive
from friso.stage.section import Rule, UncertainSection
from friso.stage.tables import friction_law

CONDITIONS = "conditions"

from_0_to_1 = Bound("from 0 to 1", lambda value: (value >= 0) & (value <= 1))


def _falls(flat: Mapping[str, Any]) -> Any:
    """Tell whether static friction is at least Coulomb friction under the operating conditions.

    The result is true for laws that lack one of these levels. It is also true if static friction is smaller without the
    conditions, because the friction law reports that.
    """
    if not {"friction.static", "friction.coulomb"} <= {*flat}:
        return True
    static, coulomb = (flat[f"friction.{x}"] * flat.get(f"{CONDITIONS}.{x}_factor", 1.0) for x in ("static", "coulomb"))
    # the law itself reports the second case
    return (static >= coulomb) | (flat["friction.static"] < flat["friction.coulomb"])


class Conditions(UncertainSection):
    """Place on the rail, load and temperature of the guide.

    They give factors on static and Coulomb friction.
    """

    place: Annotated[Value | None, Quantity("m", any_sign, "120 mm")] = None
    """Place on the rail whose friction factors apply ([rail]). A drive as built moves along the rail instead."""
    load: Annotated[float, Number(positive, "1.3")] = 1.0
    """Normal force on the guide, relative to that at which [friction] was measured."""
    load_per_acceleration: Annotated[Value, Quantity("s^2/m", non_negative, "0.02 s^2/m")] = Value(0, "0 s^2/m")
    """Growth of the load per acceleration of the reference, due for example to a centre of mass beside the drive."""
    load_share: Annotated[float, Number(from_0_to_1, "0.8")] = 1.0
    """Fraction of friction that is proportional to the normal force; the rest is due to seals and preload."""
    cold: Annotated[float, Number(positive, "1.6")] = 1.0
    """Friction of the cold machine relative to that of the warm machine, which [friction] describes."""
    running_time: Annotated[Value, Quantity("s", non_negative, "5 min")] = Value(0, "0 s")
    """Time since the machine was cold; a motion is short compared with the warm-up."""
    warm_up_time: Annotated[Value | None, Quantity("s", positive, "20 min")] = None
    """Time constant of the warm-up."""

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule(
            ("friction.model",),
            lambda flat: friction_law(flat["friction.model"]).under_conditions,
            "a law of the guide whose levels [conditions] multiply",
            'model = "lugre"',
        ),
        Rule(
            ("conditions.place",),
            lambda flat: "conditions.place" not in flat or "rail.seed" in flat,
            "a [rail] on which that place lies",
            '[rail] seed = 1, static_deviation = 0.2, correlation_length = "5 mm"',
        ),
        Rule(
            ("conditions.place",),
            _falls,
            "a place at which the rail leaves static friction no smaller than Coulomb friction",
            "static_deviation = 0.2, coulomb_deviation = 0.2 in [rail]",
        ),
        Rule(
            ("conditions.cold", "conditions.warm_up_time"),
            lambda flat: (flat.get("conditions.cold", 1.0) == 1) | ("conditions.warm_up_time" in flat),
            "the time constant of the warm-up, for a machine colder than [friction] describes",
            'warm_up_time = "20 min"',
        ),
    )
