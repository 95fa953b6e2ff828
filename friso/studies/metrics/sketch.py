"""Whether the stage hunts, by coarse return maps, or by closed orbits if maps do not decide"""

from dataclasses import replace

from friso.hunting.criteria import VERDICT_CRITERION
from friso.studies.metrics import verdict

METRIC = replace(
    verdict.METRIC,
    title="Verdict on the stage, sketched",
    source="sketch",
    place=72,
    criterion=f"sketch of the {VERDICT_CRITERION}: what attracts from a narrow range of distances may be missed",
    basis="by this sketch",
)
