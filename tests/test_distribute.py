"""Studies on a Dask cluster: the same bits, TLS, workers that die, workers that do not fit."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import dask
import psutil
import pytest
import xarray as xr
from distributed import LocalCluster
from distributed.security import Security
from patience import LIMIT
from refusals import refused

from friso.stage import Stage
from friso.studies import sweep as execute
from friso.studies.settings import StudySettings
from friso.studies.store import Store
from friso.studies.study import Request
from friso.studies.sweep import connected, run_in_memory, run_in_store, sweep

AXES = {"controller.crossover": "2 Hz..16 Hz:12", "joint.stroke": "0.1 mm..1 mm:16"}

# distributed's own: sockets that are closed by the garbage collector
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0") as cluster:
        yield cluster


@pytest.mark.slow
def test_the_same_bits_as_in_one_process(rig: Stage, cluster: LocalCluster, caplog: pytest.LogCaptureFixture) -> None:
    """Each worker compiles a kernel once; a scheduler without TLS is said to let everybody in."""

    def loaded() -> int:
        from friso.engine.kernel import _kernels

        return len(_kernels)

    with connected(cluster.scheduler_address) as crew:
        assert crew.size == 2
        for _ in range(2):
            (result,) = run_in_memory([Request(rig, AXES).study()], crew)
            assert {*crew.executor._client.run(loaded).values()} == {1}
    xr.testing.assert_identical(result, sweep(rig, AXES))
    assert f"{cluster.scheduler_address} can run code" in caplog.text


def authority(folder: Path) -> dict[str, str]:
    """A certificate that signs itself, for everybody; Dask's names for it."""
    key, certificate = str(folder / "key.pem"), str(folder / "certificate.pem")
    command = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=friso", "-days", "2"]
    subprocess.run([*command, "-keyout", key, "-out", certificate], check=True, capture_output=True)
    roles = {f"tls_{role}_{what}": file for role in ("client", "scheduler", "worker") for what, file in
             (("key", key), ("cert", certificate))}  # fmt: skip
    return {"tls_ca_file": certificate} | roles


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl to make certificates")
def test_a_scheduler_with_tls_is_reached_by_dask_s_configuration_alone(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = authority(tmp_path)
    security = Security(require_encryption=True, **names)
    with LocalCluster(
        n_workers=1, threads_per_worker=1, security=security, protocol="tls://", dashboard_address=None
    ) as cluster:
        address = cluster.scheduler_address
        assert address.startswith("tls://")
        with StudySettings(scheduler_timeout=2.0).in_use(), refused("--scheduler"), connected(address):
            pass
        settings = {"ca-file": names["tls_ca_file"], "client.cert": names["tls_client_cert"]}
        settings["client.key"] = names["tls_client_key"]
        with (
            StudySettings(scheduler_timeout=LIMIT).in_use(),
            dask.config.set({f"distributed.comm.tls.{name}": file for name, file in settings.items()}),
            connected(address) as crew,
        ):
            assert crew.size == 1
    assert not [record for record in caplog.records if record.name == "friso"]


@pytest.mark.thorough
def test_a_killed_worker_costs_only_its_blocks(rig: Stage, tmp_path: Path) -> None:
    study, path = Request(rig, AXES).study(rtol=1e-9), tmp_path / "a.zarr"
    computed: list[int] = []
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0") as cluster,
        connected(cluster.scheduler_address) as crew,
    ):
        pids = list(crew.executor._client.run(os.getpid).values())

        def kill_after_two(done: int, total: int, what: str) -> None:
            computed.append(done)
            if len(computed) == 3:
                psutil.Process(pids[0]).kill()

        run_in_store(study, path, crew, kill_after_two)
    with Store.opened(path, study) as store:
        assert list(store.missing()) == []
        stage = store.read().load()
    assert computed == sorted({*computed})  # every block was handed over once
    assert computed[-1] == study.cells
    whole = sweep(rig, AXES, rtol=1e-9)
    for name in ("outcome", "status"):
        stage[name] = stage[name].astype(object)
    xr.testing.assert_identical(stage, whole)


def test_a_worker_with_another_friso_is_refused(
    rig: Stage, cluster: LocalCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also one that joins later."""
    other = "9.9.9 (0123456789ab)"
    with connected(cluster.scheduler_address) as crew:
        crew.arguments["expected"] = other
        with refused("--scheduler"):
            run_in_memory([Request(rig, AXES).study()], crew)
    monkeypatch.setattr(execute, "equations_version", lambda: other)
    with refused("--scheduler") as error, connected(cluster.scheduler_address):
        pass
    assert other in str(error.value)


def test_a_scheduler_that_does_not_answer_or_has_no_workers() -> None:
    with StudySettings(scheduler_timeout=0.3).in_use():
        for address in ("tcp://127.0.0.1:9", "nonsense", "tcp://no.such.host.invalid:8786"):
            with refused("--scheduler"), connected(address):
                pass
    with (
        LocalCluster(n_workers=0, dashboard_address=":0") as empty,
        refused("--scheduler"),
        connected(empty.scheduler_address),
    ):
        pass


@pytest.mark.slow
def test_a_scheduler_that_dies_is_said_so(rig: Stage) -> None:
    scheduler = LocalCluster(n_workers=1, threads_per_worker=1, processes=True, dashboard_address=":0")

    def close(done: int, total: int, what: str) -> None:
        scheduler.close()

    with pytest.raises(RuntimeError, match="lost a block"), connected(scheduler.scheduler_address) as crew:
        run_in_memory([Request(rig, AXES).study(rtol=1e-8)], crew, close)


@pytest.mark.slow
def test_ctrl_c_leaves_no_task_behind(rig: Stage, cluster: LocalCluster) -> None:
    def interrupt(done: int, total: int, what: str) -> None:
        raise KeyboardInterrupt

    with connected(cluster.scheduler_address) as crew:
        with pytest.raises(KeyboardInterrupt):
            run_in_memory([Request(rig, AXES).study(rtol=1e-8)], crew, interrupt)
        (result,) = run_in_memory([Request(rig, AXES).study()], crew)
    assert (result.outcome != "").all()
