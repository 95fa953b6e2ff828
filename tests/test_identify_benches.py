"""Measured benches: KU Leuven linear guide, Univ. of Tokyo two-inertia motor bench (see shared/data/README.md)."""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from scipy import signal

from friso.identification.response.analysis import visible
from friso.identification.response.closed_loop import feedback
from friso.identification.response.departure import departure, explained, friction_from_departure
from friso.identification.response.estimators import multisine
from friso.identification.response.mass_line import mass_lines
from friso.identification.response.modes import fit_modes
from friso.identification.response.records import ResponseRecord, relative_error
from friso.identification.response.response import Channels, FrequencyResponse
from friso.identification.response.two_mass import TwoMass, fit_two_mass, widened

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
    return multisine([leuven(number)[output] for number in numbers], 5.0, Channels("voltage", "V", "position", "m"))


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
    assert re.findall(r"\b\d+\b", response.warnings[0]) == ["4999", "5000"]
    assert feedback(leuven(1)[0]) == ()


def test_leuven_realisations_lie_in_each_others_bands() -> None:
    both, single = leuven_response((1, 2), 0), [leuven_response((number,), 0) for number in (1, 2)]
    apart = np.abs(single[0].response - single[1].response) / 2  # of each from their mean
    band = (both.frequency > 3) & (both.frequency < 20)
    assert 0.5 < np.sqrt(np.mean((apart / both.deviation)[band] ** 2)) < 2
    assert np.median(both.distortion / both.noise) > 3  # friction, not noise, makes them differ


def test_leuven_antiresonance_and_resonance() -> None:
    modes = fit_modes(leuven_response((1, 2), 0), BAND)
    assert (modes.shape.modes, modes.shape.rigid) == (1, True)
    assert modes["antiresonance 1 frequency"].value == pytest.approx(11, abs=1)
    assert modes["resonance 1 frequency"].value == pytest.approx(14, abs=1)
    assert 0.02 < modes["resonance 1 damping ratio"].low < modes["resonance 1 damping ratio"].high < 0.15
    two = leuven_model((1, 2))
    for name in ("antiresonance", "resonance"):
        single, double = modes[f"{name} 1 frequency"], two[f"{name} frequency"]
        assert max(single.low, double.low) < min(single.high, double.high)


@pytest.mark.parametrize(("train", "aside"), [(1, 2), (2, 1)])
def test_leuven_prediction_of_the_other_realisation(train: int, aside: int) -> None:
    """The prediction is as good as the one from the other realisation's own measured response, for both encoders."""
    model = leuven_model((train,))
    for output, collocated in ((0, True), (1, False)):
        record = leuven(aside)[output]
        error = relative_error(lambda f, c=collocated: model.predict(f, c), record, (3, 20), 5.0)
        measured = leuven_response((train,), output)
        copied = relative_error(
            lambda f, m=measured: (
                np.interp(f, m.frequency, m.response.real) + 1j * np.interp(f, m.frequency, m.response.imag)
            ),
            record,
            (3, 20),
            5.0,
        )
        assert error < 0.2
        assert error < 1.05 * copied


def test_leuven_two_masses_agree_between_realisations() -> None:
    single = [leuven_model((number,)) for number in (1, 2)]
    both = widened(leuven_model((1, 2)), single)
    for name in ("driven mass", "other mass", "joint stiffness", "resonance frequency"):
        for model in single:
            assert both[name].low < model[name].high
            assert model[name].low < both[name].high
        assert both[name].half_width < 0.1 * both[name].value


@pytest.mark.parametrize("name", ["joint damping", "resonance damping ratio", "antiresonance damping ratio"])
def test_leuven_realisations_share_their_damping(name: str) -> None:
    one, other = (leuven_model((number,))[name] for number in (1, 2))
    assert max(one.low, other.low) < min(one.high, other.high)
    assert all(0 < estimate.low < estimate.high < 3 * estimate.value for estimate in (one, other))


def test_leuven_departure_by_friction() -> None:
    model = leuven_model((1, 2))
    result = departure(leuven_response((1, 2), 0), model.predict)
    assert 1 < result.frequency.value < 4
    assert result.differ
    low = signal.butter(4, 40, fs=1000, output="sos")
    velocities = [signal.sosfiltfilt(low, np.gradient(leuven(number)[0].output, 1e-3)) for number in (1, 2)]
    drag = friction_from_departure(leuven_response((1, 2), 0), velocities, (0.1, 5.0), model.signs[0])
    assert 0 < drag.coulomb.low < drag.coulomb.high < 0.5  # below the peak of the input, which moves it
    assert drag.left < 0.3
    wording("\n".join(drag.warnings))
    once = [leuven(number)[0].input[-4999:] for number in (1, 2)]
    explanation = explained(drag, leuven_response((1, 2), 0), once, 1e-3, (0.1, 5.0))
    assert explanation.left < 0.5
    inertia = {
        factor: np.abs(response.accelerations().response[:8]).mean()
        for factor, response in explanation.responses.items()
    }
    assert inertia[0.5] < 0.5 * inertia[2.0]
    total = model["total mass"]
    assert drag.mass.low < total.high
    assert total.low < drag.mass.high


# Tokyo


def test_tokyo_mass_lines() -> None:
    lower, upper = mass_lines(tokyo("theta_mx"))
    assert lower.level.value == pytest.approx(107, rel=0.05)
    assert upper.level.value == pytest.approx(225, rel=0.05)
    assert lower.high < 55 < 77 < upper.low


def test_tokyo_modes() -> None:
    modes = fit_modes(tokyo("theta_mx"))
    assert modes["antiresonance 1 frequency"].value == pytest.approx(55, abs=1)
    assert modes["resonance 1 frequency"].value == pytest.approx(77, abs=1)
    seen = visible(tokyo("theta_mx"), modes)
    assert seen.case == "sliding"
    assert seen.words[-1].startswith("cart sliding")


def test_tokyo_second_encoder_counts_the_other_way() -> None:
    fit = fit_two_mass(tokyo("theta_mx"), tokyo("theta_my"))
    assert fit.signs == (1.0, -1.0)
    wording("\n".join(fit.warnings))
    assert fit["total mass"].value == pytest.approx(1 / 107, rel=0.05)
    assert fit["resonance frequency"].value == pytest.approx(77, abs=1)
