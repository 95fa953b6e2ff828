"""`friso doctor`: whether friso works on this machine, in a text without names of folders."""

import json
import sys
from pathlib import Path

import pytest
from inside import friso_inside

from friso.studies import doctor
from friso.studies.settings import StudySettings


def test_this_machine_works(tmp_path: Path) -> None:
    done = friso_inside(tmp_path, "doctor", "--json")
    assert done.returncode == 0
    document = json.loads(done.stdout)
    assert document["works"]
    assert {"friso", "Python", "processor", "kept code", "compiling", "running"} <= {
        finding["subject"] for finding in document["findings"]
    }
    formats = {finding["subject"] for finding in document["findings"] if finding["subject"].endswith(" files")}
    assert formats <= {f"{name} files" for name in ("mat", "tdms", "uff", "lvm", "parquet", "workbook")}


def test_no_folder_of_the_user_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    from friso.engine.cache import cache_folder

    monkeypatch.setenv("HOME", str(cache_folder().parent))
    text = " ".join(finding.text for finding in doctor.checks())
    assert str(cache_folder().parent) not in text
    assert cache_folder().name in text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        (str(PermissionError(13, "denied", r"D:\profiles\ann\friso")), r"[Errno 13] denied: '~\\friso'"),
        (r"C:\Users\ANNMIL~1\AppData\Local\Temp", r"~\AppData\Local\Temp"),
        ("/home/bea/friso", "~/friso"),
        (r"D:\Profiles\Anna", r"D:\Profiles\Anna"),
        ("/scratch/ann/friso", "/scratch/USER/friso"),
        ("/scratch/annual/friso", "/scratch/annual/friso"),
        ("cannot use /home/bea because it is full, as /var/tmp is", "cannot use ~ because it is full, as /var/tmp is"),
        (r"C:\Users\Bea Miller\AppData is full", r"~\AppData is full"),
        ("/scratch/friso_ann/x and /data/Ann: full", "/scratch/friso_USER/x and /data/USER: full"),
    ],
)
def test_no_user_is_named(text: str, shown: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "home", lambda: Path(r"D:\Profiles\Ann"))
    monkeypatch.setattr(doctor.getpass, "getuser", lambda: "ann")
    assert doctor._without_names(text) == shown


@pytest.mark.skipif(sys.platform == "win32", reason="modes tell nothing there")
def test_of_kept_code_it_is_said_what_is_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("friso.engine.cache.cache_folder", lambda: tmp_path)
    for mode, words in ((0o700, "closed to other users"), (0o755, "open to other users")):
        tmp_path.chmod(mode)
        assert doctor._kept_code().endswith(f", {words}")
    monkeypatch.setattr("friso.engine.cache.is_passing", lambda folder: True)
    assert ", which is deleted at the end, " in doctor._kept_code()


def test_a_user_without_a_home_is_answered(monkeypatch: pytest.MonkeyPatch) -> None:
    def none() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", none)
    monkeypatch.setattr(doctor, "_running", lambda: "well")
    monkeypatch.setattr(doctor, "_compiling", lambda: "well")
    assert all(finding.works for finding in doctor.checks())


@pytest.mark.slow
def test_a_wrong_result_and_what_cannot_be_loaded_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def no_compiler() -> str:
        raise ImportError("libstdc++.so.6: cannot open shared object file")

    with StudySettings(expected_swing=2e-3).in_use():
        monkeypatch.setattr(doctor, "_processor", no_compiler)
        broken = {finding.subject: finding for finding in doctor.checks() if not finding.works}
        assert set(broken) == {"processor", "running"}
        assert all(finding.remedy for finding in broken.values())
        done = friso_inside(tmp_path, "doctor")
        assert done.returncode == 1
        assert all(f" {subject} " in done.stdout for subject in ("packages", "processor", "running"))  # none is cut
        assert "libstdc++" in done.stdout
