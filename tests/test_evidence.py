"""Test stored findings: their equations' revision, and that documents state the stored values."""

import copy
from pathlib import Path

import pytest

from benchmarks import evidence as command
from benchmarks.canonical import differ, reference_numbers
from benchmarks.code_digest import DIGITS, code_digest
from benchmarks.code_digest import computed as syntax
from friso.evidence import equations, findings_on_file, value

ROOT = Path(__file__).parent.parent

FEW = 20
"""Machines below which a share is hardly one."""


@pytest.mark.slow
def test_the_equations_are_those_on_file() -> None:
    changed = differ(equations().numbers)
    assert not changed, f"the equations have changed ({changed}): run python -m benchmarks.evidence --equations"


def test_no_finding_is_older_than_the_equations() -> None:
    outdated = command.old(findings_on_file())
    assert not outdated, f"compute again by python -m benchmarks.evidence {' '.join(outdated)}"


def test_every_finding_names_the_code_it_rests_on() -> None:
    assert [name for name, entry in findings_on_file().items() if not entry.rests_on] == []


@pytest.mark.slow
def test_a_finding_older_than_its_code_is_dated_where_it_stands() -> None:
    """If criteria, methods or experiments have changed since, every document states the day of the finding.

    `python -m benchmarks.evidence` computes it again.
    """
    undated = [
        (name, document)
        for name in command.older_than_code(findings_on_file())
        for document in findings_on_file()[name].stated
        if findings_on_file()[name].day not in " ".join((ROOT / document).read_text(encoding="utf-8").split())
    ]
    assert undated == []


def test_a_digest_holds_what_is_computed_and_not_its_words() -> None:
    source = 'def f(x, y=2):\n    """Doc."""\n    z = x + y\n    return np.mean(z), f"mean {z}"\n'
    words = source.replace("z", "total").replace("Doc", "Other").replace('"mean ', '"average ')
    assert syntax(source) == syntax(words)
    others = [source.replace(*pair) for pair in (("=2", "=3"), ("np.mean", "np.median"), ("+", "-"), ("y=2", "y"))]
    assert len({syntax(source), *map(syntax, others)}) == 5
    assert len(code_digest(["hunting/criteria"])) == DIGITS
    assert code_digest([]) == ""


@pytest.mark.slow
def test_a_finding_of_an_earlier_revision_is_outdated(monkeypatch: pytest.MonkeyPatch) -> None:
    later = command.Equations(equations().revision + 1, equations().since, equations().numbers)
    monkeypatch.setattr(command.evidence, "equations", lambda: later)
    assert command.old(findings_on_file()) == list(findings_on_file())
    again = command.renewed(findings_on_file()["hunting.locked-rig"], {"edge_hz": 9.7, "fold_hz": 16.0})
    assert command.old({"hunting.locked-rig": again}) == []
    assert again.note == ""


def test_other_physics_differ_and_rounding_does_not() -> None:
    numbers = copy.deepcopy(reference_numbers())
    force = numbers["touching"]["force"]
    force[0] *= 1 + 1e-9
    assert differ(numbers) == []
    force[0] *= 1 + 1e-5
    assert differ(numbers) == ["touching: force"]


@pytest.mark.parametrize("name", findings_on_file())
def test_documents_state_what_is_on_file(name: str) -> None:
    for document, phrases in findings_on_file()[name].stated.items():
        text = " ".join((ROOT / document).read_text(encoding="utf-8").split())
        assert [phrase for phrase in phrases if " ".join(phrase.split()) not in text] == []


def test_findings_on_few_machines_say_so() -> None:
    """A share that was measured on machines drawn at random says on how many; of fewer than 20, wherever it stands."""
    drawn = [entry for entry in findings_on_file().values() if "drawn" in entry.about]
    assert drawn
    for entry in drawn:
        count = f"{entry.values['machines']:g} machines"
        few = entry.values["machines"] < FEW
        assert not few or all(count in phrase for phrases in entry.stated.values() for phrase in phrases)


def test_the_file_is_as_the_command_writes_it() -> None:
    assert command.FILE.read_text(encoding="utf-8") == command.written(findings_on_file(), equations())


def test_every_finding_has_a_way_to_be_computed_again() -> None:
    assert {*command.QUICK, *command.LONG, *command.BY_HAND} == set(findings_on_file())
    assert all(entry.command and entry.values for entry in findings_on_file().values())


def test_findings_say_what_their_values_say() -> None:
    """Phrases of the documents beside the numbers on file."""
    assert f"{value('rig.in-position', 'rms_ratio'):.2g}" == "3.1"
    assert value("rig.hunting", "locked_at_8_hz") == 12
    assert value("rig.hunting", "locked_none_from_hz") == 12.5
    assert value("compare.thesis-rig", "isolator_settled") == 1908
