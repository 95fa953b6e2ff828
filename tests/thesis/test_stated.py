"""Statements about the model and its runs that no figure shows, judged on cases made to hold and to fail."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import sympy as sp
import xarray as xr
from made_maps import made

from friso_thesis.studies.thesis.claims import Evidence, Finding, Response, by_peak_count, by_way, registered
from friso_thesis.studies.thesis.experiments import RESPONSE_FREQUENCIES, LockedLine
from friso_thesis.studies.thesis.judges.arguments import HEAVIEST, LIGHT
from friso_thesis.studies.thesis.judges.stated import (
    COULOMB,
    PRINTED_LEVEL,
    PRINTED_RATE,
    SIGMA_0,
    STATIC,
    V,
    Z,
    judged_fixed,
    judged_friction,
    judged_noise,
    judged_touch,
)
from friso_thesis.studies.thesis.studies import STUDIES, thesis_rig

Y, N = True, False


def judged(claim: str, **evidence: Any) -> Finding:
    return registered()[claim].judge(Evidence(evidence.pop("maps", {}), evidence.pop("responses", {}), **evidence))


def test_the_printed_friction() -> None:
    assert judged("E3").pattern == (Y, Y, Y)
    level = STATIC + (COULOMB - STATIC) * sp.exp(-(V**2))  # static and Coulomb friction exchanged
    assert judged_friction(V - SIGMA_0 * sp.Abs(V) / level * Z, level).pattern == (Y, N, Y)
    assert judged_friction(V - sp.Abs(V) / PRINTED_LEVEL * Z, PRINTED_LEVEL).pattern == (N, Y, Y)  # without sigma_0
    assert judged_friction(PRINTED_RATE - Z, PRINTED_LEVEL).pattern[2] is N


def test_beta_and_the_fixed_values() -> None:
    assert judged("E8").pattern == (Y, Y)
    finding = judged("T2")
    assert finding.pattern == (N,)
    assert judged_fixed([STUDIES["path"]]).pattern == (Y,)
    assert judged("S41F").pattern == (N,)


def test_when_the_limiter_is_touched() -> None:
    assert judged("T1", rig=thesis_rig()).pattern == (Y, Y)  # 2.4 N of 3 N; 121 N
    flat = thesis_rig().flat()
    assert judged_touch({**flat, "joint.stroke": 2e-3}).pattern == (N, Y)
    assert judged_touch({**flat, "motion.acceleration": 1.0}).pattern == (Y, N)


@pytest.mark.parametrize(("late", "pattern"), [(0.0, (Y,)), (2.0, (N,))])
def test_ten_seconds(late: float, pattern: Any) -> None:
    """Runs come to rest everywhere, without counted peaks or with two."""
    runs = made("path", lambda a, t: late + 0 * a * t)
    runs = runs.assign(outcome=runs["outcome"].copy(data=np.full(runs["outcome"].shape, "rests")))
    evidence = by_way(Evidence({"path": runs}, {}), by_peak_count)
    assert registered()["S322"].judge(evidence).pattern == pattern


@pytest.mark.parametrize(("factor", "pattern"), [(1.1, (Y,)), (1.3, (N,))])
def test_the_initial_response(factor: float, pattern: Any) -> None:
    """What follows 0.3 s does not count."""
    time = np.linspace(0.0, 20.0, 2001)
    light = np.exp(-time)

    def response(position: np.ndarray) -> Response:
        trace = xr.Dataset({"position": ("time", position), "reference": ("time", 0 * time)}, {"time": time})
        return Response(xr.Dataset(), trace)

    heavy = np.where(time <= 0.3, factor, 3.0) * light
    assert judged("S41I", responses={LIGHT: response(light), HEAVIEST: response(heavy)}).pattern == pattern


def test_the_noise_of_the_appendix() -> None:
    rates = np.array(RESPONSE_FREQUENCIES)
    still = np.ones((2, len(rates)))

    def line(scatter: np.ndarray) -> LockedLine:
        return LockedLine(still, 0 * still, scatter)

    inside = np.where((rates >= 10) & (rates <= 80), 0.1, 0.01)
    identified = cast(Any, SimpleNamespace(locked_line=line(inside)))
    assert judged("A1", identified=identified).pattern == (Y, N)
    assert judged_noise(line(np.where(rates <= 5, 0.1, 0.01))).pattern == (N, N)  # at 5 Hz
    assert judged_noise(line(0.1 + 0 * rates)).pattern == (N, N)  # everywhere
