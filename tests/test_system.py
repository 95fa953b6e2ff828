"""Cores that a process may use: those it is confined to, and the time that a container leaves it."""

import math
import os
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from friso.engine import batch
from friso.platform import system
from friso.stage import Stage
from friso.studies.sweep import sweep

GROUPS = {
    "none": ("0::/\n", {}, math.inf),
    "version 2": ("0::/box\n", {"box/cpu.max": "150000 100000"}, 1.5),
    "version 2 without a limit": ("0::/box\n", {"box/cpu.max": "max 100000"}, math.inf),
    "the group above": ("0::/pod/box\n", {"pod/cpu.max": "50000 100000", "pod/box/cpu.max": "max 100000"}, 0.5),
    "seen from inside a container": ("0::/../elsewhere\n", {"cpu.max": "200000 100000"}, 2.0),
    "version 1": (
        "4:memory:/box\n3:cpuset:/\n2:cpu,cpuacct:/box\n0::/\n",
        {"cpu/box/cpu.cfs_quota_us": "300000", "cpu/box/cpu.cfs_period_us": "100000"},
        3.0,
    ),
    "version 1 without a limit": (
        "1:cpu:/\n0::/\n",
        {"cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"},
        math.inf,
    ),
    "version 1 in a container": (
        "1:cpu:/docker/0123\n",
        {"cpu/cpu.cfs_quota_us": "100000", "cpu/cpu.cfs_period_us": "100000"},
        1.0,
    ),
}

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="control groups are Linux's")


@pytest.mark.parametrize(("own", "files", "share"), GROUPS.values(), ids=GROUPS)
def test_the_time_that_a_container_leaves(own: str, files: dict[str, str], share: float, tmp_path: Path) -> None:
    root = tmp_path / "groups"
    for name, content in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(f"{content}\n")
    (tmp_path / "cgroup").write_text(own)
    assert system._share_of_time(tmp_path / "cgroup", root) == share


@pytest.mark.parametrize(("share", "cores"), [(0.5, 1), (1.0, 1), (1.5, 2), (math.inf, 3)])
def test_cores_are_those_allowed_and_no_more_than_the_time(
    share: float, cores: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0, 1, 5})
    monkeypatch.setattr(system, "_share_of_time", lambda: share)
    assert system.usable_cores() == cores


def test_one_core_runs_no_second_thread(rig: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(system, "_share_of_time", lambda: 1.0)

    class Refused(ThreadPoolExecutor):
        def __init__(self, *arguments: object) -> None:
            raise AssertionError(f"a pool of {arguments} threads")

    monkeypatch.setattr(batch, "ThreadPoolExecutor", Refused)
    runs = sweep(rig, {"controller.crossover": "2 Hz..16 Hz:24"})
    assert runs.outcome.size == 24
