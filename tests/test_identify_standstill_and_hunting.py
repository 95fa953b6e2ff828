"""Logs of standstill and of hunting: what is identified from invented logs and from a simulated rig."""

from pathlib import Path

import numpy as np
import pytest
from refusals import refused

import friso
from friso.identification.experiments.hunting import KIND, PredictedCycle, swings_of
from friso.identification.experiments.standstill import StandstillResult, wandering
from friso.identification.readings.common import record

STEP = 1e-3


def made(name: str, deviation: np.ndarray, reference: float = 0.05) -> friso.identification.logs.log.Log:
    return record(name, STEP, reference=np.full(len(deviation), reference), position=reference + deviation)


def test_standstill_is_told_about_its_mean() -> None:
    """A sine has the RMS of its amplitude over the root of two, whatever its mean."""
    time = np.arange(0, 10, STEP)
    one, two = (
        wandering(made(name, 3e-9 + size * np.sin(2 * np.pi * time))) for name, size in (("a", 1e-8), ("b", 4e-8))
    )
    assert (one.rms, one.peak) == pytest.approx((1e-8 / 2**0.5, 1e-8), rel=1e-3)
    assert abs(one.drift) < one.rms
    assert StandstillResult((one, two)).ratios[1] == pytest.approx((4.0, 4.0), rel=1e-3)


@pytest.mark.parametrize("noise", [0.0, 3e-5])
def test_cycles_of_hunting_are_counted_whatever_the_noise(noise: float) -> None:
    """Ten cycles of 1.6 s, half a millimetre to one side and a quarter to the other; between them nine whole ones."""
    time = np.arange(0, 16, STEP)
    wave = np.sin(2 * np.pi * time / 1.6 - 0.5)
    swing = np.where(wave > 0, 5e-4, 2.5e-4) * wave + np.random.default_rng(1).normal(0, noise, len(time))
    shown = swings_of(made("hunts", swing))
    assert shown.count == 9
    assert shown.period == pytest.approx(1.6, rel=0.01)
    assert shown.amplitude == pytest.approx(3.75e-4, abs=3 * noise + 1e-6)
    assert (shown.above, shown.below) == pytest.approx((5e-4, 2.5e-4), abs=4 * noise + 1e-6)
    assert shown.middle == pytest.approx(1.25e-4, abs=4 * noise + 1e-6)
    assert KIND.numbers(shown)["extremes_m"] == pytest.approx((-2.5e-4, 5e-4), abs=4 * noise + 1e-6)


def test_swings_without_a_reference_are_told_about_their_middle() -> None:
    time = np.arange(0, 16, STEP)
    wave = np.sin(2 * np.pi * time / 1.6 - 0.5)
    shown = swings_of(record("alone", STEP, position=0.05 + np.where(wave > 0, 5e-4, 2.5e-4) * wave))
    assert shown.middle == pytest.approx(0.0, abs=1e-6)


def test_a_log_of_standstill_with_its_force_is_told_how_to_go_on(tmp_path: Path) -> None:
    rng, log = np.random.default_rng(0), tmp_path / "stands.csv"
    columns = [np.arange(3000) * STEP, np.full(3000, 0.1), 0.1 + rng.normal(0, 1e-8, 3000), rng.normal(0, 0.01, 3000)]
    header = "time [s],reference [m],position [m],force [N]"
    np.savetxt(log, np.column_stack(columns), delimiter=",", header=header, comments="")
    with pytest.raises(friso.InputError, match="--as standstill"):
        friso.identify([log])


def test_a_log_without_cycles_is_refused() -> None:
    with refused("rests, position"):
        swings_of(made("rests", np.linspace(1e-4, 0.0, 5000)))


@pytest.mark.slow
def test_the_simulated_rig_hunts_as_predicted(tmp_path: Path) -> None:
    """Through the command's function, the stage given: measured over predicted is one."""
    stage = friso.load(friso.example("thesis_rig")).replace({"joint.locked": True})
    run = friso.simulate(stage).data
    time = np.arange(0, 20, 2e-3)
    columns = [np.interp(time, run.time.values, run[name].values) for name in ("reference", "position")]
    log = tmp_path / "hunting.csv"
    np.savetxt(
        log, np.column_stack([time, *columns]), delimiter=",", header="time [s],reference [m],position [m]", comments=""
    )
    (experiment,) = friso.identify([log], as_="hunting", stage=stage).experiments
    result = experiment.result
    assert isinstance(result.predicted, PredictedCycle)
    assert result.period == pytest.approx(result.predicted.period, rel=0.05)
    assert result.amplitude == pytest.approx(result.predicted.amplitude, rel=0.03)  # the transient is left out
