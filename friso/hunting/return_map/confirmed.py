"""Check by runs that stages land where the return maps predict."""

from __future__ import annotations

import numpy as np

from friso.hunting.attractors.settings import settings as survey_settings
from friso.hunting.cycle.rest import stuck
from friso.hunting.return_map.attracting import MapSurvey
from friso.hunting.return_map.landings import LANDING_RTOL, find_landings
from friso.hunting.return_map.settings import settings as return_map_settings
from friso.hunting.settings import tolerance_settings


def runs_land_as_foretold(survey: MapSurvey, numbers: np.ndarray) -> np.ndarray:
    """Return for which stages runs land where the map predicts, in the shape of `numbers`.

    A stage lands where it sticks after a swing. Runs begin stuck at three distances from which the stage rests, and at
    three from which it keeps swinging. One more begins in the widest gap between starts of the map. Each is followed
    for some landings, at the tolerance of the map and at a hundredth of it. The prediction for a landing starts from
    the landing before. From the second landing on, every landing must lie within the allowed scatter of its prediction.
    """
    begun = [_starts(survey, int(number)) for number in numbers]
    owners = np.repeat(np.arange(len(numbers)), [len(starts) for starts in begun])
    right = np.ones(len(numbers), bool)
    for rtol in (LANDING_RTOL, tolerance_settings.check_rtol_factor * LANDING_RTOL):
        lands = _land_as_foretold(survey, numbers[owners], np.concatenate(begun), rtol)
        right[owners[~lands]] = False
    return right


def _starts(survey: MapSurvey, stage: int) -> np.ndarray:
    """Choose distances at which runs of a stage begin stuck, to check its map, shape (runs,).

    They are in deflections of the loop by the break-away force.
    """
    mapped = survey.mapped
    runs = np.flatnonzero((mapped.owners == stage) & np.isfinite(mapped.starts))
    runs = runs[np.argsort(mapped.starts[runs], kind="stable")]
    starts, landings = mapped.starts[runs], mapped.landings
    last = landings.distances[runs, landings.count[runs]] / mapped.stages.length[stage]
    goes_on = ~landings.rest[runs] & mapped.maps[stage].goes_on(last)
    kinds = [which for which in map(np.flatnonzero, (goes_on, ~goes_on)) if which.size]
    shares = np.array(return_map_settings.checked_start_shares)
    chosen = np.concatenate([which[(shares * len(which)).astype(int)] for which in kinds])
    near = np.abs(starts) <= return_map_settings.near_starts[-1][1]
    gaps = np.flatnonzero(near[:-1] & near[1:] & (starts[:-1] * starts[1:] > 0))
    widest = gaps[np.abs(np.log(starts[gaps + 1] / starts[gaps])).argmax()]
    between = np.sign(starts[widest]) * np.sqrt(starts[widest] * starts[widest + 1])
    return np.append(starts[chosen], between)


@np.errstate(all="ignore")  # missing landings are NaN
def _land_as_foretold(survey: MapSurvey, owners: np.ndarray, starts: np.ndarray, rtol: float) -> np.ndarray:
    """Return which runs land where the maps of their stages predict, shape (runs,).

    `owners` are the numbers of the runs' stages in the `survey`. Runs begin stuck at `starts`, in deflections of the
    loop by the break-away force.
    """
    stages = survey.mapped.stages.take(owners)
    landed = find_landings(stages, stuck(stages, starts * stages.length), return_map_settings.confirmed_landings, rtol)
    distances = landed.distances / stages.length[:, None]
    lands = ~landed.lost
    for k, owner in enumerate(owners.tolist()):
        last = int(landed.count[k])
        before, after = distances[k, 1:last], np.abs(distances[k, 2 : last + 1])
        if landed.rest[k] and last:
            before, after = distances[k, 1 : last + 1], np.append(after, 0.0)
        foretold = np.abs(survey.mapped.maps[owner].foretold(before))
        apart = np.abs(foretold - after) / np.maximum(foretold, survey_settings.least_swing)
        lands[k] &= bool(
            np.all(
                (apart < return_map_settings.map_scatter_share)
                | (np.maximum(foretold, after) < survey_settings.least_swing)
            )
        )
    return lands
