"""What a run does: the time response of a stage to its motion, or of a cell of a study."""

from friso.interface.question import HUNTS, Question

QUESTION = Question(
    __name__,
    30,
    HUNTS,
    'simulate examples/lugre_stick_slip.toml --sample-time "1 ms" --out response\n'
    "A cell of a map: friso simulate --cell rig_map.zarr 3 4",
    folder="response",
    metavars={"stage": "STAGE.toml", "cell": "STORE"},
    details=True,
    runner="friso.cli.runs:run_simulate",
)
