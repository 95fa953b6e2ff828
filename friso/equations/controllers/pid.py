"""Define the base of both ways to give a PID controller, by rules or by gains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, ClassVar, Literal, cast

from friso.errors import StageError
from friso.stage import ControllerSection

EITHER_FORM = 'crossover = "8 Hz", alpha = 0.1, beta = 2 or kp = "3 N/m", ki = "4 N/(m*s)", kd = "6 N*s/m"'


class Pid(ControllerSection):
    """A PID controller, given by tuning rules or by gains."""

    kind: Literal["pid"]

    written: ClassVar[str]
    """Words for the keys of this way to give a controller, in a message."""
    needed: ClassVar[tuple[str, ...]]
    """Names of the keys of which a table that gives a controller this way has at least one."""
    asked: ClassVar[str]
    """The needed keys, in words for a message."""
    shares: ClassVar[Mapping[str, str]] = MappingProxyType({"p": "proportional", "i": "integral", "d": "derivative"})

    @classmethod
    def pick(cls, forms: Sequence[type[ControllerSection]], table: Mapping[str, Any]) -> type[Pid]:
        """Choose the class that reads a [controller] table: by rules or by gains.

        `forms` are the classes to choose from. Raises StageError for keys of both or of neither.
        """
        by_keys = sorted(cast(Sequence[type[Pid]], forms), key=lambda form: not form.recognised_by)
        keys_of = {
            form: [key for key in form.model_fields if key in {*table} - {*cls.model_fields}] for form in by_keys
        }
        used = [form for form, keys in keys_of.items() if keys]
        if len(used) > 1:
            actual = " together with ".join(f"{', '.join(keys_of[form])} ({form.written})" for form in used)
            raise StageError("", actual, "one form, not both", EITHER_FORM)
        if not used or not {*used[0].needed} & {*table}:
            actual = f"neither {' nor '.join(form.asked for form in by_keys)}"
            raise StageError("", actual, "one of the two forms", EITHER_FORM)
        return used[0]
