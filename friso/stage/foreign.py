"""List controllers and friction laws from outside friso, for `--help` and reports."""

from friso.stage.controllers import CONTROLLERS
from friso.stage.plug_ins import load_installed, plug_in_of
from friso.stage.tables import FRICTION


def foreign() -> list[str]:
    """Return the loaded controllers and friction laws from outside friso, with their modules."""
    kinds = {
        "controller": [(name, form) for name, forms in CONTROLLERS.forms.items() for form in forms],
        "friction law": FRICTION.classes.items(),
    }
    return [
        f"{kind} {name} ({cls.__module__})"
        for kind, classes in kinds.items()
        for name, cls in classes
        if plug_in_of(cls)
    ]


def installed() -> list[str]:
    """Return controllers and friction laws from outside friso, loaded or installed."""
    for registry in (CONTROLLERS, FRICTION):
        load_installed(registry.group)
    return foreign()
