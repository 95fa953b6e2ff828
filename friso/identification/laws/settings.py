"""Settings of fitting friction laws."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class LawSettings(Settings):
    """How friction laws are fitted and compared."""

    # Which laws a record supports.
    parts_left_out: int = setting(5, "")
    """Parts at least into which the records are cut in time: fewer differences decide nothing."""

    chance_of_a_worse_law: float = setting(0.05, "")
    """Chance at most with which a law that predicts as well as the best is called worse."""

    difference_of_worse_laws: float = setting(0.01, "")
    """Difference of errors, in the friction's deviation, up to which laws predict alike."""

    error_of_a_prediction: float = setting(0.3, "")
    """Share of the friction's deviation up to which a prediction is one."""

    # A log as a body dragged along what was measured.
    samples_of_a_dragged_record: int = setting(400, "")
    """Samples of a record at least."""

    most_samples_of_a_record: int = setting(8000, "")
    """Samples of a record at most: what follows is left out, which would take longer."""

    band_of_the_motion: float = setting(5.0, "")
    """Band of the motion over that of the force: friction depends on faster motion than is compared."""

    samples_of_a_dragged_period: int = setting(20, "")
    """Samples per period of the force's band that are enough."""

    tolerance_of_dragging: float = setting(1e-5, "")
    """Relative tolerance of the runs: looser ones blur derivatives."""

    # Fits of a law.
    step_of_a_logarithm: float = setting(1e-4, "")
    """Change of a logarithm for derivatives: smaller ones drown in the runs' tolerance."""

    share_of_a_first_value: float = setting(1e-3, "")
    """Share of its measure at which a number begins that was 0."""

    stiffness_factors: tuple[float, ...] = setting((0.1, 0.3, 1.0, 3.0, 10.0), "")
    """Factors of the stiffness of which the best is begun with: one alone may miss."""

    evaluations_of_a_fit: int = setting(25, "")
    """Evaluations of a fit at most."""

    tolerance_of_a_fit: float = setting(1e-4, "")
    """Change of numbers and cost that ends a fit."""

    residual_of_a_failed_run: float = setting(1.0, "")
    """Weighed residual of a run that failed: much worse than no model at all."""
