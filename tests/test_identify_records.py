"""Records as people have them: a velocity alone, a force in volts, gravity, a stage that stops short."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from refusals import refused
from test_identify_views import moves

import friso
from friso.identification.inverse_model import inverse_model, motion, unit_of
from friso.identification.kind import AnalysisSettings
from friso.identification.logs.assemble import NOTE, read_log
from friso.identification.logs.log import Log
from friso.identification.logs.roles import Mapping
from friso.identification.method import Identification, identify
from friso.identification.moves import IdentifiedMoves
from friso.identification.output_error.identifiable import IdentifiableFit, coverage
from friso.identification.output_error.to_keys import estimates_of
from friso.identification.readings.common import record
from friso.identification.readings.friction_velocity import LINEARITY_OF_SENSORS
from friso.identification.sources import log_with_signals, read_all
from friso.questions.identify.question import IdentifyAnswer

DT = 2e-3
MASS, VISCOUS, COULOMB = 6.0, 20.0, 11.0
PER_VOLT = 35.0


def axis(offset: float = 0.0) -> Log:
    """Two sines of a mass with friction and a constant force, with noise on the force."""
    time = np.arange(round(6 / DT)) * DT
    rates = 2 * np.pi * np.array([[0.5], [1.3]])
    position = np.sum(0.05 * np.sin(rates * time), axis=0)
    velocity = np.sum(0.05 * rates * np.cos(rates * time), axis=0)
    acceleration = np.sum(-0.05 * rates**2 * np.sin(rates * time), axis=0)
    force = MASS * acceleration + VISCOUS * velocity + COULOMB * np.sign(velocity) + offset
    force = force + 0.05 * np.random.default_rng(4).standard_normal(len(time))
    return record("axis", DT, position=position, velocity=velocity, force=force)


def csv(path: Path, heads: str, *columns: np.ndarray) -> Path:
    rows = [",".join(f"{number:.9g}" for number in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([heads, *rows]) + "\n")
    return path


# --- a velocity alone -------------------------------------------------------------------------------------------------


def test_a_position_is_the_integral_of_a_velocity_alone(tmp_path: Path) -> None:
    """Each stretch between gaps is integrated from 0."""
    log = axis()
    names, velocity = "time [s],velocity [mm/s],force [N]", 1e3 * log["velocity"]
    path = csv(tmp_path / "speed.csv", names, log.time, velocity, log["force"])
    (file,) = read_all([path], Mapping(experiment="moves"), tmp_path)
    assert isinstance(file.source, Log)
    assert NOTE in file.source.warnings
    assert file.source["position"] == pytest.approx(log["position"] - log["position"][0], abs=DT**2)
    masses = [inverse_model(one, 5.0).value("mass") for one in (log, file.source)]
    assert masses[1] == pytest.approx(masses[0], rel=0.01)
    keep = np.r_[0:1000, 1500:2500]
    read = read_log(csv(tmp_path / "gap.csv", "time [s],velocity [m/s]", log.time[keep], log["velocity"][keep]))
    assert [read["position"][part.start] for part in read.segments] == [0.0, 0.0]
    assert read["position"][999] == pytest.approx(log["position"][999] - log["position"][0], abs=DT**2)


def test_a_velocity_is_not_integrated_beside_what_may_be_the_position(tmp_path: Path) -> None:
    log = axis()
    names, place = "time [s],velocity [m/s],qm [m]", log["position"]
    path = csv(tmp_path / "qm.csv", names, log.time, log["velocity"], place)
    assert NOTE not in read_log(path).warnings
    with refused("position"):
        read_log(csv(tmp_path / "two.csv", f"{names},qn [m]", log.time, log["velocity"], place, place))
    assert NOTE not in read_log(path, Mapping(roles={"position": "qm"})).warnings
    assert NOTE in read_log(path, Mapping(roles={"velocity": "velocity"})).warnings


# --- a force in volts -------------------------------------------------------------------------------------------------


def test_units_of_mechanics_with_volts_in_place_of_newtons() -> None:
    volts = replace(axis(), units={"force": "V"})
    units = {"kg": "V*s^2/m", "N*s/m": "V*s/m", "N": "V", "N/m": "V/m", "m/s": "m/s", "": ""}
    assert {unit: unit_of(unit, volts) for unit in units} == units
    assert unit_of("kg", axis()) == "kg"


@pytest.fixture(scope="module")
def volts(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Identification]:
    log = axis()
    path = tmp_path_factory.mktemp("volts") / "volts.csv"
    csv(path, "time [s],position [m],command [V]", log.time, log["position"], log["force"] / PER_VOLT)
    mapping = Mapping(roles={"force": "command"}, experiment="moves")
    return path, identify(
        [(log_with_signals(path, mapping, "moves"), "moves")], settings=AnalysisSettings(bandwidth=5.0)
    )


def test_a_force_in_volts_yields_estimates_per_volt(volts: tuple[Path, Identification]) -> None:
    (experiment,) = volts[1].experiments
    identified: IdentifiedMoves = experiment.result
    estimates = {estimate.name: estimate for estimate in identified.estimates}
    mass, coulomb = estimates["masses.cart"], estimates["friction.coulomb"]
    assert (mass.unit, coulomb.unit) == ("V*s^2/m", "V")
    assert mass.value == pytest.approx(MASS / PER_VOLT, rel=0.02)
    assert coulomb.value == pytest.approx(COULOMB / PER_VOLT, rel=0.05)


def test_what_needs_newtons_is_not_written_and_says_so(volts: tuple[Path, Identification]) -> None:
    path, identification = volts
    assert identification.stage is None
    assert identification.estimates == ()
    files = read_all([path], Mapping(roles={"force": "command"}, experiment="moves"), path.parent)
    answer = IdentifyAnswer(identification, inputs=files, predictions=[], checked=None)
    said = [
        *answer.sentences(),
        *answer.details(),
        *(text for block in answer.tables() for row in block.rows for text in row[1]),
    ]
    assert not any(" N " in text or text.endswith(" N") for text in said)
    assert "mass_v_s2_per_m" in answer.to_dict()["experiments"][0]["inverse_model"]


def test_newtons_of_a_stage_and_moves_too_quick_for_one_are_refused(volts: tuple[Path, Identification]) -> None:
    """A log in volts needs a scale for a stage file; and milliseconds were taken for seconds."""
    (experiment,) = volts[1].experiments
    with refused("force"):
        identify([(experiment.logs[0], "moves")], friso.load("examples/emps_axis.toml"))
    log = axis()
    with refused("position"):
        identify([(record("hasty", 1e-3 * DT, position=log["position"], force=log["force"]), "moves")])


# --- what following the log costs -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("in_loop", "share"), [(True, 0.0), (False, 0.05)])
def test_static_friction_is_less_certain_where_the_stage_follows_the_log(in_loop: bool, share: float) -> None:
    fit = moves(own_loop=in_loop, fitted_in_loop=in_loop)[0].fit
    every = tuple(range(len(fit.inner)))
    sure = replace(fit, free=every, covariance=1e-12 * np.eye(len(every)))
    names = frozenset(parameter.name for parameter in fit.problem.parameters)
    covered = coverage(axis()["position"], motion(axis()["position"], DT, 25.0), MASS, COULOMB, DT)
    estimates = {one.name: one for one in estimates_of(IdentifiableFit(sure, {}, names), covered)[0]}
    static, coulomb = (estimates[f"friction.{name}"] for name in ("static", "coulomb"))
    assert static.half_width == pytest.approx(max(share, LINEARITY_OF_SENSORS) * static.value, rel=1e-3)
    assert coulomb.half_width == pytest.approx(LINEARITY_OF_SENSORS * coulomb.value, rel=1e-3)
