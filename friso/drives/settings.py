"""Settings of `friso.drives`, with a reason for each."""

from __future__ import annotations

from dataclasses import dataclass

from friso.settings import Settings, setting


@dataclass(frozen=True)
class TargetSettings(Settings):
    """Settings of controllers that leave friso."""

    vector_samples: int = setting(4000, "")
    """Samples of a test vector. Of most drives they last through a move; ten times as many make files of megabytes."""

    text_samples: int = setting(400, "")
    """Samples of the test in structured text, which stand in its source. Editors of PLCs slow down beyond thousands."""

    output_rounding: float = setting(1e-11, "")
    """Difference from friso that rounding explains, relative to the largest output. Compilers order sums otherwise, and
    filters magnify rounding: over the 58 stages of the tests the largest was 2e-12."""

    input_roundings: float = setting(16.0, "")
    """Roundings of each input, times its direct gain, that the output may differ besides. Where a velocity is a
    difference of large positions, these exceed the rounding of the output."""

    single_reserve: float = setting(4.0, "")
    """Difference from friso in single precision, relative to that of friso's own run in single precision. Compilers
    that order sums otherwise have come to twice that."""

    machine_samples: int = setting(200, "")
    """Samples over which a machine as a plant is compared with friso. Behind the first impacts of a limiter runs that
    begin a rounding apart differ by the stroke."""

    machine_steps: tuple[int, ...] = setting((1, 4, 16), "")
    """Steps in a sample for which the difference of a machine from friso is told; sixteen take seconds."""

    usual_steps: int = setting(4, "")
    """Steps in a sample of a machine as a plant: with one, the contact of a limiter is a few steps long."""

    machine_rounding: float = setting(1e-9, "")
    """Difference between a machine in C and in Python that rounding explains, relative to the largest position. Kinks
    magnify rounding."""

    section_rounding: float = setting(1e-6, "")
    """Largest relative difference between biquads and state space at which the biquads are told. Poles that nearly
    coincide lose digits."""

    section_points: int = setting(200, "")
    """Frequencies at which biquads are compared with the state space; a notch is a tenth of a decade wide."""

    cancelling_distance: float = setting(1e-9, "")
    """Distance of a zero and a pole in z that cancel, and size of what is infinite. Rounding of a pole is 1e-15, of a
    double one 1e-8."""


settings = TargetSettings.live()


@dataclass(frozen=True)
class DriveFileSettings(Settings):
    """Settings of reading parameter files of drives."""

    characters_looked_at: int = setting(100_000, "")
    """Longest part of a file of another kind that is looked at for gains. Parameter files have fewer characters."""

    gains_said: int = setting(6, "")
    """Largest number of what may be gains that is said of a file of another kind. More fill the screen."""

    least_gain_ratio: float = setting(0.01, "")
    """Least ratio of scheduled gains in a stage whose drive lets them fall to 0: a loop needs some gain."""


drive_settings = DriveFileSettings.live()
