"""`python -m friso`: the command line, where the folder of scripts is not on the PATH."""

from friso.cli import main

main()
