"""Fig. 16: crossover and stroke of the isolated rig, at both stiffnesses of the joint."""

from __future__ import annotations

from friso.equations.controllers.van_dijk import CROSSOVER
from friso.quantities import percent
from friso.studies.thesis.claims import ABOUT, Evidence, Finding, Part, judges
from friso.studies.thesis.maps import ends, share_text, verdict_table
from friso.studies.thesis.studies import SOFT, thesis_rig

_AXES = (CROSSOVER, "joint.stroke")

_SAME = 0.15
"""Share by which a limit that "no longer depends" on the stroke may still change."""


@judges("F16A", figure="16A", needs=("isolator-crossover",))
def isolated_rig_needs_crossover(evidence: Evidence) -> Finding:
    """The crossover below which the isolated rig keeps moving, at each stroke."""
    crossover, stroke, moving, valid = verdict_table(evidence.maps["isolator-crossover"], *_AXES)
    limits = ends(crossover, moving)
    long, longest = stroke >= stroke[-1] / 2, stroke >= 0.75 * stroke[-1]
    third, fourth = limits[long & ~longest].mean(), limits[longest].mean()
    below = (crossover[:, None] < limits[None, :]) & long[None, :] & valid
    return Finding(
        (
            Part(
                "at every stroke of the upper half of the range it keeps moving at some crossover, and at none from a "
                "higher "
                "one on",
                bool(moving[:, long].any(axis=0).all() and not moving[-1, long].any()),
                f"mean limit {limits[long].mean():.3g} Hz ({limits[long].min():.3g} to {limits[long].max():.3g} Hz); "
                f"{share_text(moving, below)} of the cells below it keep moving",
            ),
            Part(
                "the mean limits over the third and over the fourth quarter of the strokes differ by at most "
                f"{percent(_SAME)}, and the limit of stroke 0 is higher than both by a factor of {ABOUT:g} at least",
                bool(abs(third - fourth) <= _SAME * third and limits[0] >= ABOUT * max(third, fourth)),
                f"{third:.3g} Hz over the third and {fourth:.3g} Hz over the fourth quarter; {limits[0]:.3g} Hz at "
                "stroke 0",
            ),
        )
    )


@judges("F16B", figure="16B", needs=("isolator-crossover", "isolator-crossover-soft"))
def softer_joint_lowers_the_limit(evidence: Evidence) -> Finding:
    """The limits of both stiffnesses, stroke by stroke."""
    names = ("isolator-crossover", "isolator-crossover-soft")
    maps = [verdict_table(evidence.maps[name], *_AXES) for name in names]
    stiff, soft = (ends(crossover, moving) for crossover, _, moving, _ in maps)
    stroke = maps[0][1]
    long = stroke >= stroke[-1] / 2
    drop = (stiff - soft)[long]
    cell = float(maps[0][0][1] - maps[0][0][0])
    return Finding(
        (
            Part(
                f"over the strokes of the upper half of the range, the mean limit at {SOFT['joint.stiffness']} is "
                f"lower than at {thesis_rig().flat()['joint.stiffness']:g} N/m by at least one cell of the crossover "
                f"grid ({cell:.3g} Hz)",
                bool(drop.mean() >= cell),
                f"{soft[long].mean():.3g} against {stiff[long].mean():.3g} Hz: a drop of {drop.mean():.3g} Hz; lower "
                f"at {(drop > 0).sum()} of {drop.size} strokes, higher at {(drop < 0).sum()}",
            ),
        )
    )
