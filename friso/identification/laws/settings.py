"""Settings of fitting friction laws."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class LawSettings(Settings):
    """Settings of the fit and comparison of friction laws."""

    # Which laws a record supports.
    parts_left_out: int = setting(5, "")
    """Fewest parts into which the records are cut in time. Fewer differences decide nothing."""

    chance_of_a_worse_law: float = setting(0.05, "")
    """Probability at which a law as good as the best is called worse."""

    difference_of_worse_laws: float = setting(0.01, "")
    """Difference of errors, in the friction's deviation, below which laws predict equally well."""

    error_of_a_prediction: float = setting(0.3, "")
    """Largest relative error of a useful prediction."""

    # A log as a body dragged along what was measured.
    samples_of_a_dragged_record: int = setting(400, "")
    """Fewest samples of a record."""

    most_samples_of_a_record: int = setting(8000, "")
    """Most samples of a record; further ones are left out, because they take longer."""

    band_of_the_motion: float = setting(5.0, "")
    """Band of the motion over that of the force. Friction depends on faster motion than is compared."""

    samples_of_a_dragged_period: int = setting(20, "")
    """Samples per period of the force's band."""

    tolerance_of_dragging: float = setting(1e-5, "")
    """Relative tolerance of the runs. Looser ones blur derivatives."""

    # Fits of a law.
    step_of_a_logarithm: float = setting(1e-4, "")
    """Change of a logarithm for derivatives. Smaller ones drown in the tolerance of the runs."""

    share_of_a_first_value: float = setting(1e-3, "")
    """Initial value of a number that was 0, relative to its scale."""

    stiffness_factors: tuple[float, ...] = setting((0.1, 0.3, 1.0, 3.0, 10.0), "")
    """Factors of the stiffness from which fits start. One alone may miss the best."""

    evaluations_of_a_fit: int = setting(25, "")
    """Most evaluations of a fit."""

    tolerance_of_a_fit: float = setting(1e-4, "")
    """Change of numbers and cost that ends a fit."""

    residual_of_a_failed_run: float = setting(1.0, "")
    """Weighted residual of a run that failed, much worse than no model."""
