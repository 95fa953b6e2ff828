"""Measured benches: KU Leuven linear guide, Univ. of Tokyo two-inertia motor bench (see shared/data/README.md)."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from friso.identification.estimate import Estimate
from friso.identification.response.analysis import departure, feedback, visible
from friso.identification.response.mass_line import mass_lines
from friso.identification.response.masses import TwoMass, fit_two_mass, widened
from friso.identification.response.modes import fit_modes
from friso.identification.response.records import Channels, FrequencyResponse, ResponseRecord, multisine, relative_error

DATA = Path(__file__).parents[2] / "shared" / "data"
BAND = (3.0, 20.1)


def present(name: str) -> Path:
    if not (DATA / name).exists():
        pytest.skip(f"{name} is not beside the repository")
    return DATA / name


@cache
def leuven(number: int) -> tuple[ResponseRecord, ResponseRecord]:
    """Realisation `number`: the records of both encoders [m]."""
    path = present(f"kuleuven_lsb250/exp{number}.mat")
    log = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=False)[f"exp{number}"]
    by_name = {channel.Name: np.asarray(channel.Data, float) for channel in log.Y}
    voltage = by_name["input (V)"]
    first, second = (ResponseRecord(voltage, 1e-3 * by_name[f"enc{i} (mm)"], 1e-3) for i in (1, 2))
    return first, second


@cache
def leuven_response(numbers: tuple[int, ...], output: int) -> FrequencyResponse:
    return multisine([leuven(number)[output] for number in numbers], Channels("voltage", "V", "position", "m"))


@cache
def leuven_model(numbers: tuple[int, ...]) -> TwoMass:
    return fit_two_mass(leuven_response(numbers, 0), leuven_response(numbers, 1), BAND)


@cache
def tokyo(output: str) -> FrequencyResponse:
    log = scipy.io.loadmat(present("utokyo_motorbench/MultisineTypeA.mat"), squeeze_me=True)
    record = ResponseRecord(log["iq_adx"], log[output], 1 / float(log["fs"]))
    return multisine([record], channels=Channels("current", "A", "angle", "rad"))


# KU Leuven


def test_leuven_lines_and_exact_period() -> None:
    """The README says 5 s; the input repeats after 4999 samples."""
    response = leuven_response((1, 2), 0)
    assert len(response.frequency) == 100
    assert response.frequency[0] == pytest.approx(1 / 4.999)
    assert feedback(leuven(1)[0]) == ()


def test_leuven_realisations_lie_in_each_others_bands() -> None:
    both, single = leuven_response((1, 2), 0), [leuven_response((number,), 0) for number in (1, 2)]
    apart = np.abs(single[0].response - single[1].response) / 2  # of each from their mean
    band = (both.frequency > 3) & (both.frequency < 20)
    assert 0.5 < np.sqrt(np.mean((apart / both.deviation)[band] ** 2)) < 2
    assert np.median(both.distortion / both.noise) > 3  # friction, not noise, makes them differ


def overlap(one: Estimate, other: Estimate) -> bool:
    return max(one.low, other.low) < min(one.high, other.high)


@pytest.mark.slow
def test_leuven_antiresonance_and_resonance() -> None:
    modes = fit_modes(leuven_response((1, 2), 0), BAND)
    assert (modes.shape.modes, modes.shape.rigid) == (1, True)
    assert modes["antiresonance 1 frequency"].value == pytest.approx(11, abs=1)
    assert modes["resonance 1 frequency"].value == pytest.approx(14, abs=1)
    assert 0.02 < modes["resonance 1 damping ratio"].low < modes["resonance 1 damping ratio"].high < 0.15
    two = leuven_model((1, 2))
    for name in ("antiresonance", "resonance"):
        assert overlap(modes[f"{name} 1 frequency"], two[f"{name} frequency"])


@pytest.mark.slow
@pytest.mark.parametrize(("train", "aside"), [(1, 2), (2, 1)])
def test_leuven_prediction_of_the_other_realisation(train: int, aside: int) -> None:
    """The prediction is as good as the one from the other realisation's own measured response, for both encoders."""
    model = leuven_model((train,))
    for output, collocated in ((0, True), (1, False)):
        record, measured = leuven(aside)[output], leuven_response((train,), output)

        def copied(f: np.ndarray, m: FrequencyResponse = measured) -> np.ndarray:
            return np.interp(f, m.frequency, m.response.real) + 1j * np.interp(f, m.frequency, m.response.imag)

        error = relative_error(lambda f, c=collocated: model.predict(f, c), record, (3, 20))
        assert error < 0.2
        assert error < 1.05 * relative_error(copied, record, (3, 20))


def test_leuven_realisations_agree_in_masses_and_damping() -> None:
    one, other = (leuven_model((number,)) for number in (1, 2))
    both = widened(leuven_model((1, 2)), [one, other])
    for name in ("driven mass", "other mass", "joint stiffness", "resonance frequency"):
        assert all(overlap(both[name], model[name]) for model in (one, other))
        assert both[name].half_width < 0.1 * both[name].value
    for name in ("joint damping", "resonance damping ratio", "antiresonance damping ratio"):
        assert overlap(one[name], other[name])
        assert all(0 < model[name].low < model[name].high < 3 * model[name].value for model in (one, other))


def test_leuven_departure_by_friction() -> None:
    model, response = leuven_model((1, 2)), leuven_response((1, 2), 0)
    result = departure(response, model.predict)
    assert 1 < result.frequency.value < 4
    assert result.differ


# Tokyo


def test_tokyo_mass_lines() -> None:
    lower, upper = mass_lines(tokyo("theta_mx"))
    assert lower.level.value == pytest.approx(107, rel=0.05)
    assert upper.level.value == pytest.approx(225, rel=0.05)
    assert lower.high < 55 < 77 < upper.low


@pytest.mark.slow
def test_tokyo_modes() -> None:
    modes = fit_modes(tokyo("theta_mx"))
    assert modes["antiresonance 1 frequency"].value == pytest.approx(55, abs=1)
    assert modes["resonance 1 frequency"].value == pytest.approx(77, abs=1)
    seen = visible(tokyo("theta_mx"), modes)
    assert seen.case == "sliding"


@pytest.mark.slow
def test_tokyo_second_encoder_counts_the_other_way() -> None:
    fit = fit_two_mass(tokyo("theta_mx"), tokyo("theta_my"))
    assert fit.signs == (1.0, -1.0)
    assert fit["total mass"].value == pytest.approx(1 / 107, rel=0.05)
    assert fit["resonance frequency"].value == pytest.approx(77, abs=1)
