"""Register sections from other packages and files, and find them again in another process.

Friso's own sections are named here. Installed packages name theirs in entry points, which are read if a name in a stage
file is not friso's own.

A kernel is built in a separate process, which gets the plug-ins with its task. A plug-in is a friction law or a
controller from another package, from one file, or from the script that runs.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from friso.errors import InputError
from friso.platform.installed import installed_modules, leave_out, load_module

OWN = "friso"
SCRIPT = "__main__"


@dataclass(frozen=True)
class PlugIn:
    """A module from outside friso: its name, and the file it was loaded from ("" for none)."""

    module: str
    file: str

    @property
    def digest(self) -> str:
        """Return a digest of the module's source."""
        return hashlib.sha256(Path(self.file).read_bytes() if self.file else b"").hexdigest()

    def load(self) -> None:
        """Import the module, unless it has been imported; a script is always run again.

        The module is imported by its name if that leads to its file, else from the file. Raises ImportError if there is
        no file.
        """
        if self.module in sys.modules and self.module != SCRIPT:
            return
        if (
            self.module != SCRIPT
            and (spec := importlib.util.find_spec(self.module))
            and Path(spec.origin or "").resolve() == Path(self.file)
        ):
            importlib.import_module(self.module)
            return
        name = "friso_script" if self.module == SCRIPT else self.module
        spec = importlib.util.spec_from_file_location(name, self.file) if self.file else None
        if spec is None or spec.loader is None:
            raise ImportError(f"{self.module}, which registers a section, has no file that it could be loaded from")
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)


def plug_in_of(cls: type) -> PlugIn | None:
    """Return the plug-in that a class comes from; None for friso's own."""
    if cls.__module__.split(".")[0] == OWN:
        return None
    file = getattr(sys.modules.get(cls.__module__), "__file__", None)
    return PlugIn(cls.__module__, str(Path(file).resolve()) if file else "")


def plug_ins(classes: Iterable[type]) -> tuple[PlugIn, ...]:
    """Return the plug-ins that classes come from, each once."""
    return tuple(dict.fromkeys(plug_in for cls in classes if (plug_in := plug_in_of(cls))))


FRISO = {
    "friso.controllers": ("friso.equations.controllers", "friso.identification.state_space_controller"),
    "friso.friction": ("friso.equations.friction",),
    "friso.motions": ("friso.equations.motions", "friso.identification.recorded_motion"),
    "friso.derivations": ("friso.leaf_springs.closed_forms", "friso.equations.conditions"),
}
"""Modules that register friso's own sections of the stage file, by group.

They belong to higher layers, and are imported when a stage is first read.
"""


def load_own(group: str) -> None:
    """Import friso's own modules of a group, such as "friso.controllers"."""
    for module in FRISO.get(group, ()):
        if module not in sys.modules:
            importlib.import_module(module)


@cache
def load_installed(group: str) -> None:
    """Import the modules of installed packages in a group of entry points.

    The modules register their sections. A package that cannot be imported, or registers a name that is taken, is
    reported and skipped.
    """
    for name, module in installed_modules(group).items():
        try:
            load_module(group, name, module)
        except InputError as error:
            leave_out(error)
