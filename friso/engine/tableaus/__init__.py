"""Coefficients of linearly implicit methods, one file each."""

from friso.engine.tableaus.rodas4 import RODAS4
from friso.engine.tableaus.rodas5p import RODAS5P

TABLEAUS = {tableau.name: tableau for tableau in (RODAS4, RODAS5P)}
