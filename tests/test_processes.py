"""Studies in processes of this machine: the same bits, no port that others reach, processes that die."""

import os
import signal
import subprocess
import sys
import textwrap
from contextlib import suppress
from pathlib import Path

import psutil
import pytest
import xarray as xr
from patience import LIMIT
from systems import posix

from friso.stage import Stage
from friso.studies.store import Store
from friso.studies.study import Request, cells_of
from friso.studies.sweep import processes, run_in_memory, run_in_store, sweep

AXES = {"controller.crossover": "2 Hz..16 Hz:12", "joint.stroke": "0.1 mm..1 mm:16"}


@pytest.mark.slow
def test_processes_of_its_own_give_the_same_and_open_no_port(
    rig: Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The processes also do not run a file in the current folder that has the name of a module they import."""
    seen: list[psutil.Process] = []
    hostile = "open('run', 'w').close()\nraise SystemExit\n"
    (tmp_path / "multiprocessing.py").write_text(hostile)
    monkeypatch.chdir(tmp_path)

    def look(done: int, total: int, what: str) -> None:
        seen[:] = psutil.Process().children(recursive=True)
        own = [*psutil.Process().net_connections("inet"), *(c for p in seen for c in p.net_connections("inet"))]
        assert not [connection for connection in own if connection.status == psutil.CONN_LISTEN]

    with processes(2) as crew:
        (result,) = run_in_memory([Request(rig, AXES).study()], crew, look)
    xr.testing.assert_identical(result, sweep(rig, AXES))
    assert seen
    alive = [process for process in seen if process.is_running() and process.status() != psutil.STATUS_ZOMBIE]
    assert not [process for process in alive if "spawn_main" in str(process.cmdline())]
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
def test_a_process_that_is_killed_costs_nothing_that_is_done(rig: Stage, tmp_path: Path) -> None:
    study, path, done_by_then = Request(rig, AXES).study(rtol=1e-9), tmp_path / "a.zarr", []

    def kill(done: int, total: int, what: str) -> None:
        done_by_then.append(done)
        if len(done_by_then) == 3:
            next(iter(crew.executor._processes.values())).kill()  # pyright: ignore[reportAttributeAccessIssue]

    with pytest.raises(RuntimeError, match="lost a block"), processes(2) as crew:
        run_in_store(study, path, crew, kill)
    with Store.opened(path, study) as store:
        left = sum(map(cells_of, store.missing()))
        assert 0 < left <= study.cells - done_by_then[2]


PARENT = """
import time
from friso.studies.sweep import processes

with processes(1) as crew:
    crew.executor.submit(time.sleep, 0).result()
    print(*crew.executor._processes, flush=True)
    time.sleep(1e6)
"""


@pytest.mark.slow
@posix
@pytest.mark.parametrize("kill", [False, True])
def test_a_temporary_cache_is_shared_and_removed(tmp_path: Path, kill: bool) -> None:
    """Workers end with who started them, however that ends, and remove it."""
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    (tmp_path / "parent.py").write_text(f"if __name__ == '__main__':\n{textwrap.indent(PARENT, '    ')}")
    environ = {**os.environ, "FRISO_CACHE_DIR": str(tmp_path / "open"), "TMPDIR": str(tmp_path)}
    with subprocess.Popen(
        [sys.executable, tmp_path / "parent.py"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environ
    ) as parent:
        worker = psutil.Process(int(parent.stdout.readline()))
        assert len([*tmp_path.glob("friso-kernels-*")]) == 1
        parent.send_signal(signal.SIGKILL if kill else signal.SIGINT)
    with suppress(psutil.NoSuchProcess):
        worker.wait(LIMIT)
    assert not [*tmp_path.glob("friso-kernels-*")]
