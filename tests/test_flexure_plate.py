"""A leaf as a plate: its closed forms against a Ritz solution, and their limits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ritz import plate as ritz

from friso.leaf_springs import mechanism

FEW = settings(max_examples=12)
SLENDER = st.floats(0.8, 6.0)
"""Length over width, where the shares that converge are known."""
POISSON = st.floats(0.0, 0.45)
METAL = st.floats(0.2, 0.35)
WIDTH = 0.03


@pytest.mark.slow
@FEW
@given(ratio=SLENDER, poisson=POISSON)
def test_stiffening_is_that_of_the_plate(ratio: float, poisson: float) -> None:
    assert mechanism.stiffening(ratio, 1.0, poisson) == pytest.approx(ritz(ratio, 1.0, poisson).stiffening, rel=5e-3)


@FEW
@given(ratio=SLENDER, poisson=st.floats(0.05, 0.45))
def test_one_function_across_is_exact(ratio: float, poisson: float) -> None:
    expected = 1 + (mechanism.stiffening(ratio, 1.0, poisson) - 1) / mechanism.CONVERGED_STIFFENING
    assert expected == pytest.approx(ritz(ratio, 1.0, poisson, along=10, across=2).stiffening, rel=1e-6)


@pytest.mark.slow
@FEW
@given(ratio=SLENDER, poisson=METAL)
def test_share_that_converges(ratio: float, poisson: float) -> None:
    """The fraction of the stiffening is 0.866 to 0.901 for metals."""
    expected = (mechanism.stiffening(ratio, 1.0, poisson) - 1) / mechanism.CONVERGED_STIFFENING
    assert (ritz(ratio, 1.0, poisson).stiffening - 1) / expected == pytest.approx(
        mechanism.CONVERGED_STIFFENING, abs=0.025
    )


@pytest.mark.slow
@settings(max_examples=6)
@given(ratio=SLENDER, poisson=METAL)
def test_stress_at_mid_width(ratio: float, poisson: float) -> None:
    largest = mechanism.stress_factors(ratio, 1.0, poisson)[1]
    assert largest == pytest.approx(float(ritz(ratio, 1.0, poisson, along=20, across=8).clamp_stress(0.0)), rel=0.03)


def test_ritz_converges() -> None:
    coarse, fine = ritz(0.07, 0.045, 0.3), ritz(0.07, 0.045, 0.3, along=20, across=8)
    assert coarse.stiffening == pytest.approx(fine.stiffening, rel=1e-4)
    assert fine.stiffening == pytest.approx(2.540 / 2.3625, rel=2e-3)  # shells, references.md, section 3


@given(poisson=POISSON)
@settings(max_examples=20)
@pytest.mark.parametrize("odd", [True, False])
def test_limits(poisson: float, odd: bool) -> None:
    """A narrow leaf is a beam, a wide one bends into a cylinder."""
    assert mechanism.stiffening(1e5, 1.0, poisson, odd) == pytest.approx(1, rel=1e-4)
    cylinder = 1 / (1 - poisson**2)
    expected = 1 + (mechanism.stiffening(1.0, 1e5, poisson, odd) - 1) / mechanism.CONVERGED_STIFFENING
    assert expected == pytest.approx(cylinder, rel=1e-4)
    ratios = np.geomspace(0.1, 100, 40)
    rising = mechanism.stiffening(ratios, 1.0, poisson, odd)
    assert np.all(np.diff(rising) <= 1e-9)
    assert np.all((rising >= 1 - 1e-9) & (rising <= cylinder + 1e-9))


def test_without_lateral_contraction_a_leaf_is_a_beam() -> None:
    ratios = np.geomspace(0.3, 30, 20)
    for odd in (True, False):
        assert mechanism.stiffening(ratios, 1.0, 0.0, odd) == pytest.approx(1, abs=1e-12)
    mean, largest = mechanism.stress_factors(ratios, 1.0, 0.0)
    assert mean == pytest.approx(1, abs=1e-12)
    assert largest == pytest.approx(1, abs=1e-12)
    assert ritz(1.5, 1.0, 0.0).stiffening == pytest.approx(1, abs=1e-9)


@given(ratio=SLENDER, poisson=POISSON)
@settings(max_examples=30)
def test_profile_has_the_stiffness_of_the_plate(ratio: float, poisson: float) -> None:
    """The compliance along the leaf, weighted by the square of the moment, equals that of the whole."""
    nodes, weights = np.polynomial.legendre.leggauss(80)
    s = nodes * ratio * WIDTH / 2
    profile = mechanism.compliance_profile(s, ratio * WIDTH, WIDTH, poisson)
    expected = np.sum(weights * profile * s**2) / np.sum(weights * s**2)
    assert expected == pytest.approx(1 / mechanism.stiffening(ratio * WIDTH, WIDTH, poisson), rel=1e-9)


@given(ratio=SLENDER, poisson=POISSON)
@settings(max_examples=30)
def test_curl_vanishes_at_the_clamps(ratio: float, poisson: float) -> None:
    for odd in (True, False):
        curl = mechanism.Curl.of(ratio, 1.0, poisson, odd)
        s = ratio / 2 * (1 - np.array([0.0, 1e-5, 2e-5]))
        at, near, far = curl.shape(s, ratio)
        assert at == pytest.approx(0, abs=1e-9)
        assert far == pytest.approx(4 * near, rel=1e-3)  # its slope is 0 as well
        numeric = (curl.shape(0.1 + 1e-4, ratio) - 2 * curl.shape(0.1, ratio) + curl.shape(0.1 - 1e-4, ratio)) / 1e-8
        assert curl.shape(0.1, ratio, derivative=2) == pytest.approx(numeric, rel=1e-3, abs=1e-3)


@given(thickness=st.floats(0.02, 0.2), poisson=POISSON)
@settings(max_examples=20)
def test_torsion(thickness: float, poisson: float) -> None:
    """Far from its clamps a leaf twists as Saint-Venant's; the clamps of a short one forbid it to warp."""
    shear, length = 8e10, 1e4
    free = shear * mechanism.torsion_constant(1.0, thickness) / length
    assert mechanism.torsion_stiffness(length, 1.0, thickness, shear, poisson) == pytest.approx(free, rel=1e-3)
    short = mechanism.torsion_stiffness(0.01, 1.0, thickness, shear, poisson) * 0.01
    assert short > 100 * free * length
    nodes, weights = np.polynomial.legendre.leggauss(60)
    share = weights @ mechanism.free_twist(nodes, 2.0, 1.0, poisson) / 2  # the mean rate of twist is its compliance
    stiff = mechanism.torsion_stiffness(2.0, 1.0, thickness, shear, poisson)
    assert stiff == pytest.approx(free * length / 2 / share, rel=1e-9)


@pytest.mark.parametrize(("ratio", "factor"), [(1.0, 0.1406), (0.5, 0.2287), (0.2, 0.2913), (0.1, 0.3123)])
def test_torsion_constant(ratio: float, factor: float) -> None:
    """Timoshenko & Goodier, Theory of Elasticity, Sec. 109."""
    assert mechanism.torsion_constant(1.0, ratio) == pytest.approx(factor * ratio**3, rel=3e-3)


def test_arrays_are_one_by_one() -> None:
    lengths, widths, poissons = np.array([0.03, 0.07, 0.1]), np.array([0.03, 0.045, 0.02]), np.array([0.3, 0.0, 0.4])
    for odd in (True, False):
        alone = [mechanism.stiffening(*sizes, odd) for sizes in zip(lengths, widths, poissons, strict=True)]
        assert mechanism.stiffening(lengths, widths, poissons, odd) == pytest.approx(alone, rel=1e-13)
    stresses = [mechanism.stress_factors(*sizes) for sizes in zip(lengths, widths, poissons, strict=True)]
    assert np.allclose(np.transpose(mechanism.stress_factors(lengths, widths, poissons)), stresses, rtol=1e-13, atol=0)
