"""A package that adds to friso a question, and an experiment of the rig; its entry points, as
tests/test_plug_in_packages.py installs it:

[project.entry-points."friso.questions"]
resting = "friso_resting.resting"
[project.entry-points."friso.rig_experiments"]
at-rest = "friso_resting.at_rest"
"""
