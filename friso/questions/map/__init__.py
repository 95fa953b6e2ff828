"""Where does it hunt: keys swept over ranges, in memory or in a store that an interrupted study resumes from."""

from friso.interface.question import WHERE, Choices, Question

QUESTION = Question(
    __name__,
    40,
    WHERE,
    'map rig.toml --x controller.crossover="1 Hz..16 Hz:41" --y joint.stroke="0 m..1 mm:41"\n'
    "To resume an interrupted study: friso map thesis_rig_map.zarr",
    function_name="sweep",
    details=True,
    metavars={"stage": "STAGE.toml|STORE", "out": "STORE"},
    choices=Choices.of_registry("Metrics (--metric)", "friso.studies.metric:METRICS"),
    runner="friso.cli.runs:run_map",
)
