"""Define the base of the two forms of the PID controller, and tell the forms apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, ClassVar, Literal, cast

from friso.errors import StageError
from friso.stage import ControllerSection

EITHER_FORM = 'crossover = "8 Hz", alpha = 0.1, beta = 2 or kp = "3 N/m", ki = "4 N/(m*s)", kd = "6 N*s/m"'


class Pid(ControllerSection):
    """A PID controller."""

    kind: Literal["pid"]

    written: ClassVar[str]
    """Words for the keys of a form in a message."""
    needed: ClassVar[tuple[str, ...]]
    """Names of the keys of which a table of this form has at least one."""
    asked: ClassVar[str]
    """The needed keys, as written in a message."""
    shares: ClassVar[Mapping[str, str]] = MappingProxyType({"p": "proportional", "i": "integral", "d": "derivative"})

    @classmethod
    def pick(cls, forms: Sequence[type[ControllerSection]], table: Mapping[str, Any]) -> type[Pid]:
        """Return the form of a table: by rules or by gains. Raises StageError for both or neither."""
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
