"""The kinds of experiment by name, and the order in which they are analysed."""

from __future__ import annotations

from graphlib import TopologicalSorter
from typing import TYPE_CHECKING, Any

from friso.registry import Registry

if TYPE_CHECKING:  # --help lists the names and must be fast
    from friso.identification.kind import ExperimentKind

KINDS: Registry[ExperimentKind[Any]] = Registry("friso.identification.experiments", "KIND", "friso.experiments")
"""All kinds of experiment: every module of `friso/identification/experiments/` declares one, and so does every module
that an installed package names."""


def in_order(registry: Registry[Any] = KINDS) -> list[str]:
    """Return the names in a registry, each after all names in its `after`, else alphabetically."""
    before = {name: [other for other in registry[name].after if other in registry] for name in registry}
    sorter = TopologicalSorter(before)
    sorter.prepare()
    names: list[str] = []
    while sorter.is_active():
        ready = sorted(sorter.get_ready())
        names += ready
        sorter.done(*ready)
    return names
