"""Plot work against precision: time of a run against its error, over tolerances."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.metrics import Cycle, cycle, distance, sampled_maxima
from benchmarks.peers import at_once, time_out
from benchmarks.race import RUNS, Field, friso_seconds, friso_trace
from benchmarks.report import clock, print_table

LIMIT = 8.0
"""Wall time of a run [s] beyond which a method's tighter tolerances are left out."""

Curve = list[tuple[float, float, float, float]]
"""Per tolerance: rtol, seconds per run and core, error of the trace [m], relative error of the amplitude."""


def work_precision(places: list[Field], folder: Path, quick: bool) -> None:
    """Print and draw all methods' curves on all rigs, as work_precision.png in `folder`."""
    rtols = [10.0**-k for k in (range(3, 9, 2) if quick else range(3, 10))]
    curves = {place.rig.name: _curves(place, rtols) for place in places}
    for name, methods in curves.items():
        print(f"\nWork against precision, rig {name}")
        rows = [
            [method, f"{r:.0e}", f"{s * 1e6:.1f}", f"{e:.1e}", f"{a:.1e}"]
            for method, curve in methods.items()
            for r, s, e, a in curve
        ]
        print_table(("method", "rtol", "us/run/core", "rms all [m]", "amplitude err"), rows)
        _equal_precision(methods)
    _draw(curves, folder / "work_precision.png")


def _curves(place: Field, rtols: list[float]) -> dict[str, Curve]:
    truth = cycle(sampled_maxima(place.rig.grid, place.reference))
    curves = {"friso": _curve(place, rtols, truth, lambda rtol: _friso(place, rtol))}
    for name, solve in place.peers.items():

        def run(rtol: float, solve=solve) -> tuple[float, np.ndarray]:
            traces: list[np.ndarray] = []
            with time_out(LIMIT):
                seconds = clock(lambda: traces.append(at_once(solve, place.rig, place.equations, rtol, True)[0]))
            return seconds, traces[0][:, place.rig.kernel.states.index("position")]

        curves[name] = _curve(place, rtols, truth, run)
    return curves


def _friso(place: Field, rtol: float) -> tuple[float, np.ndarray]:
    runs = RUNS // 4 if rtol < 1e-6 else RUNS
    return min(friso_seconds(place.rig, rtol, runs, 1) for _ in range(3)), friso_trace(place.rig, rtol)[0]


def _curve(place: Field, rtols: list[float], truth: Cycle, run: Callable[[float], tuple[float, np.ndarray]]) -> Curve:
    curve: Curve = []
    for rtol in rtols:
        try:
            seconds, trace = run(rtol)
        except (TimeoutError, RuntimeError):
            break
        measured = cycle(sampled_maxima(place.rig.grid, trace))
        off = abs(measured.amplitude / truth.amplitude - 1)
        curve.append((rtol, seconds, distance(place.rig.grid, trace, place.reference).rms, off))
        if seconds > LIMIT / 3:
            break
    return curve


def _equal_precision(methods: dict[str, Curve]) -> None:
    """Print how many times longer each peer takes than friso for an equally precise trace.

    Times are interpolated on logarithmic scales.
    """
    work = np.log([point[1] for point in methods["friso"]])
    errors = np.log([point[2] for point in methods["friso"]])
    if np.any(np.diff(errors) >= 0):
        print(
            "  errors do not fall with rtol: limiter contact makes these traces chaotic, no equal precision to compare"
        )
        return
    order = np.argsort(errors)
    for method, curve in methods.items():
        if method != "friso" and curve:
            interpolated = [float(np.exp(np.interp(np.log(e), errors[order], work[order]))) for _, _, e, _ in curve]
            ratios = [f"{s / mine:.0f}" for mine, (_, s, _, _) in zip(interpolated, curve, strict=True)]
            print(f"  at equal rms error, {method} takes x friso: {', '.join(ratios)} (rtol as above)")


def _draw(curves: dict[str, dict[str, Curve]], file: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(curves), figsize=(6.5 * len(curves), 5), squeeze=False, layout="constrained")
    for axis, (name, methods) in zip(axes[0], curves.items(), strict=True):
        for method, curve in methods.items():
            marker = "o-" if method == "friso" else "s--"
            axis.loglog([c[2] for c in curve], [c[1] for c in curve], marker, label=method, markersize=4)
        axis.set(
            xlabel="error of the trace, rms over 20 s [m]",
            ylabel="time per run and core [s]",
            title=f"rig {name}",
        )
        axis.grid(visible=True, which="both", alpha=0.3)
        axis.legend(fontsize=8)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=130)
    plt.close(figure)
    print(f"\n  plot: {file}")
