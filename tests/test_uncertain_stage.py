"""Stage files whose quantities are uncertain, the correlations beside them, and stages drawn from both."""

import pickle
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused
from scipy.stats import kstest, norm, spearmanr, truncnorm

from friso.errors import InputError
from friso.interface.inputs import read_stage
from friso.intervals import NORMAL_COVERAGE, UncertainValue
from friso.stage import Stage, load, numeric_keys, parse_set, save
from friso.stage.correlations import (
    Correlations,
    correlations_file,
    correlations_text,
    draw,
    laid_over,
    read_correlations,
)

EXAMPLE = Path(__file__).parents[1] / "examples" / "thesis_rig.toml"
COULOMB, STATIC, VISCOUS = "friction.coulomb", "friction.static", "friction.viscous"


def uncertain(rig: Stage, **texts: str) -> Stage:
    """The rig with friction keys written like this."""
    return rig.replace({f"friction.{key}": text for key, text in texts.items()})


# reading


@pytest.mark.parametrize(
    ("text", "centre", "low", "high", "form"),
    [
        ("2.4 N +/- 0.1 N", 2.4, 2.3, 2.5, "tolerance"),
        ("2.4 N ± 100 mN", 2.4, 2.3, 2.5, "tolerance"),
        ("2.4 N +/- 5 %", 2.4, 2.28, 2.52, "tolerance"),
        ("2 N .. 3 N", 2.5, 2.0, 3.0, "range"),
        ("2000 mN..3N", 2.5, 2.0, 3.0, "range"),
        ("0.1 N +/- 3 N", 0.1, -2.9, 3.1, "tolerance"),
    ],
)
def test_centre_and_interval(rig: Stage, text: str, centre: float, low: float, high: float, form: str) -> None:
    """The float is the centre, exactly; a normal distribution may reach beyond the bound of its key."""
    stage = uncertain(rig, coulomb=text)
    assert stage.flat()[COULOMB] == centre
    (result,) = stage.uncertain().items()
    assert result[0] == COULOMB
    assert (result[1].low, result[1].high) == pytest.approx((low, high), rel=1e-12)
    assert (result[1].form, result[1].text) == (form, text)


def test_every_numeric_key_may_be_uncertain(rig: Stage) -> None:
    """All keys of the rig are tried, dimensionless ones as a text; a plain stage is not uncertain."""
    assert rig.uncertain() == {}
    assert uncertain(rig, coulomb="1 N +/- 0 N", static="3 N .. 3 N").uncertain() == {}
    inputs, expected = rig.as_written(), numeric_keys(rig.flat())
    keys = [key for key in expected if key.split(".")[1] in inputs.get(key.split(".")[0], {})]
    assert len(keys) == sum(isinstance(value, float) for value in rig.flat().values())
    texts = {key: f"{inputs[key.split('.')[0]][key.split('.')[1]]} +/- 1 %" for key in keys}
    stage = rig.replace(texts)
    assert set(stage.uncertain()) == set(keys)
    assert stage.flat() == rig.flat()
    assert stage == rig


@settings(max_examples=25)
@given(low=st.floats(0.01, 1), width=st.floats(0.001, 1), percent=st.floats(0.1, 99))
def test_save_and_load(low: float, width: float, percent: float, tmp_path_factory: pytest.TempPathFactory) -> None:
    texts = {
        COULOMB: f"{low!r} N .. {low + width!r} N",
        "controller.alpha": f"0.1 +/- {percent!r} %",
        "masses.cart": f"1.2 kg +/- {width!r} kg",
    }
    stage, path = load(EXAMPLE).replace(texts), tmp_path_factory.mktemp("s") / "stage.toml"
    save(stage, path)
    again = load(path)
    assert again == stage
    assert again.as_written() == stage.as_written()
    assert again.uncertain() == stage.uncertain()
    assert again.to_toml() == path.read_text(encoding="utf-8")


def test_value_survives_pickling_and_set(rig: Stage) -> None:
    key, text = parse_set('friction.coulomb="2 N +/- 1 N"')
    stage = rig.replace({key: text})
    value = pickle.loads(pickle.dumps(stage)).friction.coulomb
    assert isinstance(value, UncertainValue)
    assert (value, value.text, value.interval) == (2.0, "2 N +/- 1 N", stage.uncertain()[COULOMB])
    assert stage.replace({"joint.locked": True}).uncertain() == stage.uncertain()
    assert stage.replace({COULOMB: "2 N"}).uncertain() == {}


def test_single_valued_commands_say_that_centres_are_used(
    rig: Stage, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "a.toml"
    save(uncertain(rig, coulomb="1 N +/- 5 %", static="3 N +/- 5 %", viscous="0 N*s/m .. 1 N*s/m"), path)
    read_stage(path, ["masses.cart=1 kg .. 2 kg"])
    (line,) = caplog.messages
    caplog.clear()
    assert line.startswith("4 ")
    assert re.findall(r"[a-z]+\.[a-z]+", line) == ["masses.cart", "friction.static", "friction.coulomb"]
    assert "friso check --draws 1000" in line
    read_stage(path, None, uncertain_too=True)
    assert caplog.messages == []


# correlations


UNCERTAIN = {"coulomb": "1 N +/- 0.1 N", "viscous": "0.5 N*s/m +/- 0.1 N*s/m"}


def pair(value: float, keys: tuple[str, ...] = (COULOMB, VISCOUS)) -> Correlations:
    return Correlations(keys, np.array([[1, value], [value, 1]]))


def test_correlations_are_written_and_read(rig: Stage, tmp_path: Path) -> None:
    stage = uncertain(rig, **UNCERTAIN)
    path = correlations_file(tmp_path / "identified.toml")
    assert path.name == "identified.correlations.toml"
    path.write_text(correlations_text(pair(-0.8), stage))
    correlations = read_correlations(path, stage)
    assert correlations.keys == (COULOMB, VISCOUS)
    assert np.array_equal(correlations.matrix, pair(-0.8).matrix)
    assert correlations.among([VISCOUS]).keys == (VISCOUS,)
    assert correlations.among([VISCOUS]).matrix.tolist() == [[1.0]]
    assert correlations.among([]).over([COULOMB]).tolist() == [[1.0]]
    with refused("keys"):
        correlations_text(pair(0.5), uncertain(rig, coulomb="1 N +/- 0.1 N"))


BOTH = 'keys = ["friction.coulomb", "friction.viscous"]'
ONE = 'keys = ["friction.coulomb"]'
MATRICES = "[[1,0.5],[0.4,1]] [[1,1.5],[1.5,1]] [[2,0.5],[0.5,1]] [[1]] [[1,0],[1]] [] [[1,nan],[nan,1]]"


@pytest.mark.parametrize(
    "text",
    [
        *(f"{BOTH}\nmatrix = {matrix}" for matrix in MATRICES.split()),
        pytest.param(f"{ONE}\nmatrix = [[{'9' * 400}]]", id="huge"),
        'keys = ["friction.coulomb", "friction.coulomb"]\nmatrix = [[1, 0], [0, 1]]',
        'keys = ["friction.static"]\nmatrix = [[1]]',
        'keys = ["friction.colomb"]\nmatrix = [[1]]',
        'keys = "friction.coulomb"\nmatrix = [[1]]',
        f'{ONE}\nmatrix = [["1"]]',
        ONE,
        "keys = []\nmatrices = []",
        "keys = [",
        "",
    ],
)
def test_correlations_refused(rig: Stage, tmp_path: Path, text: str) -> None:
    stage, path = uncertain(rig, coulomb="1 N +/- 0.1 N", viscous="0 N*s/m .. 1 N*s/m"), tmp_path / "c.toml"
    path.write_text(text)
    with refused() as caught:
        read_correlations(path, stage)
    assert str(path) in str(caught.value)


# drawing


def test_margins_are_those_written(rig: Stage) -> None:
    stage = uncertain(rig, coulomb="1 N +/- 0.1 N", static="2.5 N .. 3.5 N")
    drawn = draw(stage, Correlations(), 4096, seed=1)
    assert drawn.left_out == 0
    assert kstest(drawn.keys[COULOMB], norm(1, 0.1 / NORMAL_COVERAGE).cdf).statistic < 0.005
    assert kstest(drawn.keys[STATIC], "uniform", args=(2.5, 1.0)).statistic < 0.005
    assert np.mean(np.abs(drawn.keys[COULOMB] - 1) < 0.1) == pytest.approx(0.95, abs=0.002)
    assert abs(spearmanr(drawn.keys[COULOMB], drawn.keys[STATIC]).statistic) < 0.02


@pytest.mark.parametrize("value", [-1.0, -0.7, 0.3, 1.0])
def test_correlations_are_those_of_the_file(rig: Stage, value: float) -> None:
    """Two normal keys have the stated correlation; with a uniform range, Spearman's is that of the copula.

    That one is 6/pi asin(rho/2).
    """
    stage = uncertain(rig, **UNCERTAIN, static="2.9 N .. 3.1 N")
    drawn = draw(stage, pair(value), 4096, seed=2)
    assert np.corrcoef(drawn.keys[COULOMB], drawn.keys[VISCOUS])[0, 1] == pytest.approx(value, abs=0.01)
    mixed = draw(stage, pair(value, (COULOMB, STATIC)), 4096, seed=2)
    expected = 6 / np.pi * np.arcsin(value / 2)
    assert spearmanr(mixed.keys[COULOMB], mixed.keys[STATIC]).statistic == pytest.approx(expected, abs=0.01)
    assert abs(spearmanr(mixed.keys[COULOMB], mixed.keys[VISCOUS]).statistic) < 0.02


def test_the_same_seed_gives_the_same_stages(rig: Stage) -> None:
    stage = uncertain(rig, coulomb="1 N +/- 0.1 N", viscous="0 N*s/m .. 1 N*s/m")
    first, again, other = (draw(stage, pair(0.5), 100, seed).keys[COULOMB] for seed in (3, 3, 4))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert first.shape == (100,)


def test_what_reaches_beyond_the_bound_is_cut_off(rig: Stage) -> None:
    drawn = draw(uncertain(rig, viscous="0.5 N*s/m +/- 1 N*s/m"), Correlations(), 2000, seed=5)
    scale = 1 / NORMAL_COVERAGE
    share = norm.cdf(-0.5 / scale)
    assert drawn.beyond / (drawn.beyond + 2000) == pytest.approx(share, rel=0.05)
    distribution = truncnorm(-0.5 / scale, np.inf, 0.5, scale)
    assert kstest(drawn.keys[VISCOUS], distribution.cdf).statistic < 0.01
    assert drawn.broken == {}


def test_draws_that_break_a_rule_are_left_out_and_told(rig: Stage) -> None:
    """For 1.8 N to 3 N against 2 N to 3 N, an area of 0.5 of 1.2 breaks the rule."""
    drawn = draw(uncertain(rig, coulomb="1.8 N .. 3 N", static="2 N .. 3 N"), Correlations(), 1000, seed=6)
    assert np.all(drawn.keys[COULOMB] <= drawn.keys[STATIC])
    ((why, count),) = drawn.broken.items()
    assert {"friction.coulomb", "friction.static"} <= {*re.findall(r"[a-z]+\.[a-z]+", why)}
    assert count == drawn.left_out
    assert count / (count + 1000) == pytest.approx(0.5 / 1.2, rel=0.05)


def test_the_controller_does_not_know_the_mass_that_was_drawn(rig: Stage) -> None:
    """A stage without uncertain keys is refused: there is nothing to draw."""
    with pytest.raises(InputError, match="uncertain"):
        draw(rig, Correlations(), 10, seed=0)
    tuned = "controller.tuned_mass"
    light = rig.replace({tuned: None, "masses.cart": "1 kg .. 2 kg"})
    assert laid_over(light, draw(light, Correlations(), 8, seed=0).keys)[tuned] == 2.0
    unknown = light.replace({tuned: "1 kg .. 2 kg"})
    own = draw(unknown, Correlations(), 8, seed=0)
    assert np.array_equal(laid_over(unknown, own.keys)[tuned], own.keys[tuned])
