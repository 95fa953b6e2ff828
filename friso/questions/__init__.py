"""The questions that friso answers: a table of all, and a folder each.

A folder holds the question's function, and what its answer says, shows and writes.
"""

from friso.interface.question import HELP, HUNTS, MACHINE, STOPS, WHERE, WHY, Choices, Question


def listed_formats() -> list[tuple[str, str]]:
    """Return the formats of logs that friso reads, with one line on each."""
    from friso.identification.logs.read import FORMATS

    return [(FORMATS[name].title, FORMATS.one_line(name)) for name in FORMATS]


TABLE = {
    question.name: (question, "")
    for question in (
        Question(
            "friso.questions.bode",
            50,
            WHY,
            'bode examples/thesis_rig.toml --frequencies "0.1 Hz..1 kHz" --out bode',
            details=True,
            during="analysing all states",
        ),
        Question(
            "friso.questions.boundary",
            60,
            WHERE,
            'boundary rig.toml --set joint.locked=true --x controller.crossover="1 Hz..40 Hz" --out edge',
            details=True,
            during="following cycles",
        ),
        Question(
            "friso.questions.check",
            20,
            HUNTS,
            'check examples/thesis_rig.toml --set controller.crossover="12 Hz" --out report',
            details=True,
            during="what attracts the stage",
        ),
        Question(
            "friso.questions.compare",
            120,
            STOPS,
            "compare examples/thesis_rig.toml --out compare\ncompare stage.toml tuned/*.toml --out compare",
            details=True,
            answers_interrupted=True,
        ),
        Question(
            "friso.questions.design",
            80,
            STOPS,
            "design examples/thesis_rig.toml examples/specs/thesis.toml --out design",
            takes=("stage", "spec"),
            folder="design",
            details=True,
            files=("design.toml", "worst.toml", "design-not-verified.toml"),
            answers_interrupted=True,
            runner="friso.cli.runs:run_design",
        ),
        Question("friso.questions.doctor", 150, HELP, "doctor", takes=(), writes=False),
        Question(
            "friso.questions.export",
            85,
            STOPS,
            'export examples/twincat_cascade.toml --set travel_per_turn="10 mm"\n'
            "The controller in C: friso export examples/twincat_cascade.toml --to c --out axis",
            choices=Choices.of_registry(
                "What --to may be; drives also for friso init --from",
                "friso.drives.drive:FORMATS",
                "friso.drives.target:TARGETS",
            ),
        ),
        Question(
            "friso.questions.flexure",
            70,
            STOPS,
            'flexure rig.toml --stroke "1 mm" --out flexure',
            during="bending the leaves",
        ),
        Question(
            "friso.questions.identify",
            100,
            MACHINE,
            'identify log.csv --stage stage.toml --map position=ActPos --scale force="35.15 N/V" --out identified',
            takes=("logs",),
            metavars={"logs": "LOG...", "stage": "STAGE.toml"},
            folder="identified",
            details=True,
            choices=Choices.of_registry("Kinds of experiment (--as)", "friso.identification.kinds:KINDS"),
            answers_interrupted=True,
            runner="friso.cli.runs:run_identify",
        ),
        Question(
            "friso.questions.logs",
            90,
            MACHINE,
            "logs log.csv --out logs",
            takes=("logs",),
            metavars={"logs": "LOG..."},
            during="reading",
            choices=Choices("Formats", listed_formats),
            runner="friso.cli.runs:run_logs",
        ),
        Question(
            "friso.questions.map",
            40,
            WHERE,
            'map rig.toml --x controller.crossover="1 Hz..16 Hz:41" --y joint.stroke="0 m..1 mm:41"\n'
            "To resume an interrupted study: friso map thesis_rig_map.zarr",
            function_name="sweep",
            details=True,
            metavars={"stage": "STAGE.toml|STORE", "out": "STORE"},
            choices=Choices.of_registry("Metrics (--metric)", "friso.studies.metric:METRICS"),
            runner="friso.cli.runs:run_map",
        ),
        Question(
            "friso.questions.simulate",
            30,
            HUNTS,
            'simulate examples/lugre_stick_slip.toml --sample-time "1 ms" --out response\n'
            "A cell of a map: friso simulate --cell rig_map.zarr 3 4",
            folder="response",
            metavars={"stage": "STAGE.toml", "cell": "STORE"},
            details=True,
            runner="friso.cli.runs:run_simulate",
        ),
        Question(
            "friso.questions.tune",
            65,
            STOPS,
            'tune examples/thesis_rig.toml --only controller --within "2 um" --out tuned',
            details=True,
            during="what attracts the stage",
            metavars={"only": "<controller|joint>", "keep": "<controller|joint>"},
            answers_interrupted=True,
        ),
    )
}
"""The questions by the names of their commands; what each is about says the docstring of its function."""
