"""The kinds of experiment by name, and the order in which they are analysed."""

from __future__ import annotations

from graphlib import TopologicalSorter
from typing import TYPE_CHECKING, Any

from friso.registry import Registry

if TYPE_CHECKING:  # the names are asked for by --help, which shall not take a second
    from friso.identification.kind import ExperimentKind

KINDS: Registry[ExperimentKind[Any]] = Registry("friso.identification.experiments", "KIND")
"""Every module of `friso/identification/experiments/` declares one."""


def in_order() -> list[str]:
    """The names of all kinds, those first whose results others use; by name where none uses the other's."""
    sorter = TopologicalSorter({name: [kind for kind in KINDS[name].after if kind in KINDS] for name in KINDS})
    sorter.prepare()
    names: list[str] = []
    while sorter.is_active():
        ready = sorted(sorter.get_ready())
        names += ready
        sorter.done(*ready)
    return names
