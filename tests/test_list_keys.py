"""Keys that take an array of values with units: reading, flat keys of the elements, setting, sweeping, uncertainty."""

import pickle

import maxwell_slip
import numpy as np
import pytest
from variants import gains, release, stage

import friso
from friso.engine.kernel import KernelRequest
from friso.equations.structure import structure
from friso.errors import InputError
from friso.stage import Stage, numeric_keys, parse_set, violations
from friso.stage.correlations import Correlations, correlations_text, draw, read_correlations
from friso.stage.section import plug_ins
from friso.studies.axes import SweptAxis, check_links, linked, read_axis
from friso.studies.cells import allowed_cells, flat_cells

STIFFNESS, STRENGTH = "friction.element_stiffness", "friction.element_strength"


@pytest.fixture(scope="module")
def three() -> Stage:
    law = """model = "maxwell_slip"
element_stiffness = ["40 N/um", "30 N/um", "30 kN/mm"]
element_strength = ["0.5 N", "1 N +/- 0.1 N", "1 N .. 3 N"]
viscous = "0.5 N*s/m"
"""
    return stage(release(), friction=law, controller=gains(1000, 500))


def test_elements_have_flat_keys_of_their_own(three: Stage) -> None:
    flat = three.flat()
    assert [flat[f"{STIFFNESS}.{n}"] for n in (1, 2, 3)] == [4e7, 3e7, 3e7]
    assert [flat[f"{STRENGTH}.{n}"] for n in (1, 2, 3)] == [0.5, 1.0, 2.0]
    assert f"{STIFFNESS}.4" not in flat
    assert STIFFNESS not in flat
    expected = numeric_keys(flat)
    assert {expected[f"{STIFFNESS}.{n}"].unit for n in (1, 2, 3)} == {"N/m"}
    assert f"{STIFFNESS}.4" not in expected


def test_saved_and_loaded_it_is_the_same(three: Stage) -> None:
    again = friso.loads(three.to_toml())
    assert again == three
    assert again.flat() == three.flat()
    assert again.as_written()["friction"]["element_stiffness"] == ["40 N/um", "30 N/um", "30 kN/mm"]
    assert pickle.loads(pickle.dumps(three)) == three


def test_the_whole_array_or_one_element_is_set(three: Stage) -> None:
    whole = three.replace(dict([parse_set(f'{STIFFNESS}=["1 N/um", "2 N/um", "3 N/um"]')]))
    assert [whole.flat()[f"{STIFFNESS}.{n}"] for n in (1, 2, 3)] == [1e6, 2e6, 3e6]
    one = three.replace(dict([parse_set(f"{STIFFNESS}.2=35 N/um")]))
    assert [one.flat()[f"{STIFFNESS}.{n}"] for n in (1, 2, 3)] == [4e7, 3.5e7, 3e7]
    assert three.flat()[f"{STIFFNESS}.2"] == 3e7
    numbers = three.with_numbers({f"{STIFFNESS}.1": 0.1 + 0.2, f"{STRENGTH}.3": 1 / 3})
    assert numbers.flat()[f"{STIFFNESS}.1"] == 0.1 + 0.2
    assert numbers.flat()[f"{STRENGTH}.3"] == 1 / 3


def test_an_element_is_swept_and_linked(three: Stage) -> None:
    axis = read_axis(three, f"{STRENGTH}.3", "1 N..3 N:3", False)
    assert not isinstance(axis, SweptAxis)
    values = axis.axis().values
    assert values == pytest.approx([1.0, 2.0, 3.0])
    links = {f"{STRENGTH}.1": f"0.25 * {STRENGTH}.3 + 0.5", f"{STIFFNESS}.1": f"{STRENGTH}.1 / 1e-7"}
    check_links(three, links, frozenset([f"{STRENGTH}.3"]))
    cells = flat_cells(three, links, {f"{STRENGTH}.3": values})
    assert cells[f"{STRENGTH}.1"] == pytest.approx([0.75, 1.0, 1.25])
    assert cells[f"{STIFFNESS}.1"] == pytest.approx([7.5e6, 1e7, 1.25e7])
    assert cells[f"{STRENGTH}.2"] == 1.0
    assert list(allowed_cells(three, {}, {f"{STRENGTH}.3": np.array([-1.0, 1.0])})) == [False, True]
    assert violations(three.flat({f"{STRENGTH}.3": np.array([-1.0, 1.0])}))[0][1].startswith(f"{STRENGTH}.3 ")
    for key in (f"{STRENGTH}.4", f"{STRENGTH}.x", STRENGTH):
        with pytest.raises(InputError, match="element_strength"):
            three.flat({key: 1.0})
    with pytest.raises(InputError, match=r"element_strength\.7"):
        check_links(three, {f"{STRENGTH}.1": f"{STRENGTH}.7"}, frozenset())
    assert linked({"a": "2 * b.c.1"}, {"b.c.1": 3.0}) == {"a": 6.0}


def test_elements_are_uncertain_and_drawn(three: Stage, tmp_path) -> None:
    intervals = three.uncertain()
    assert [*intervals] == [f"{STRENGTH}.2", f"{STRENGTH}.3"]
    assert (intervals[f"{STRENGTH}.3"].low, intervals[f"{STRENGTH}.3"].high) == (1.0, 3.0)
    expected = Correlations((f"{STRENGTH}.2", f"{STRENGTH}.3"), np.array([[1.0, 0.9], [0.9, 1.0]]))
    (tmp_path / "c.toml").write_text(correlations_text(expected, three))
    read = read_correlations(tmp_path / "c.toml", three)
    assert np.array_equal(read.matrix, expected.matrix)
    drawn = draw(three, read, 512, 1)
    second, third = drawn.keys[f"{STRENGTH}.2"], drawn.keys[f"{STRENGTH}.3"]
    assert np.mean(second) == pytest.approx(1.0, abs=0.01)
    assert np.std(second) == pytest.approx(0.1 / 1.96, rel=0.05)
    assert 1.0 <= third.min() <= third.max() <= 3.0
    assert np.corrcoef(second, third)[0, 1] > 0.8


def test_the_number_of_elements_is_part_of_the_structure(three: Stage) -> None:
    two = three.replace({STIFFNESS: ["1 N/um", "2 N/um"], STRENGTH: ["1 N", "2 N"]})
    assert structure(three.flat()).friction_variant == (3, False)
    assert structure(two.flat()).friction_variant == (2, False)
    assert structure(three.flat({f"{STIFFNESS}.1": np.array([1e6, 2e6])})) == structure(three.flat())


def test_the_law_is_a_plug_in(three: Stage) -> None:
    (plug_in,) = plug_ins(KernelRequest(structure(three.flat())).sections)
    assert plug_in.module == "maxwell_slip"
    assert plug_in.file == maxwell_slip.__file__
