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
    """Probability that a law as good as the best is called worse."""

    difference_of_worse_laws: float = setting(0.01, "")
    """Difference of errors, in standard deviations of the friction, below which laws predict equally well."""

    error_of_a_prediction: float = setting(0.3, "")
    """Largest relative error of a useful prediction."""

    # A log as a body dragged along the measured motion.
    samples_of_a_dragged_record: int = setting(400, "")
    """Fewest samples of a record to which laws are fitted."""

    most_samples_of_a_record: int = setting(8000, "")
    """Largest number of samples of a record; the rest is left out to save time."""

    band_of_the_motion: float = setting(5.0, "")
    """Ratio of the bands of motion and compared force. Friction depends on faster motion than the force shows."""

    samples_of_a_dragged_period: int = setting(20, "")
    """Samples per period of the force's band."""

    tolerance_of_dragging: float = setting(1e-5, "")
    """Relative tolerance of simulations for a fit. Looser tolerances spoil finite differences."""

    # Fits of a law.
    step_of_a_logarithm: float = setting(1e-4, "")
    """Step of a logarithm for finite differences. Smaller steps drown in the solver's tolerance."""

    share_of_a_first_value: float = setting(1e-3, "")
    """Initial value of a number that was 0, relative to its scale."""

    stiffness_factors: tuple[float, ...] = setting((0.1, 0.3, 1.0, 3.0, 10.0), "")
    """Factors on the assumed bristle stiffness from which fits start. One start alone may miss the best fit."""

    evaluations_of_a_fit: int = setting(25, "")
    """Largest number of evaluations of a fit."""

    tolerance_of_a_fit: float = setting(1e-4, "")
    """Relative change of parameters and cost that ends a fit."""

    residual_of_a_failed_run: float = setting(1.0, "")
    """Weighted residual of a failed run, much worse than without any model."""


settings = LawSettings.live()
