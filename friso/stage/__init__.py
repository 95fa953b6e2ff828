"""The stage file: a positioning stage, its controller and its motion, with units, checked."""

from friso.quantities import Number, Quantity, Value
from friso.stage.arguments import load, loads, save
from friso.stage.controllers import ControllerSection, register_controller
from friso.stage.section import Rule, Section, Several, Values, element_keys
from friso.stage.stage import Stage, numeric_keys, violations
from friso.stage.tables import FrictionSection, register_friction
from friso.stage.tables_of_files import parse_set

__all__ = [
    "ControllerSection",
    "FrictionSection",
    "Number",
    "Quantity",
    "Rule",
    "Section",
    "Several",
    "Stage",
    "Value",
    "Values",
    "element_keys",
    "load",
    "loads",
    "numeric_keys",
    "parse_set",
    "register_controller",
    "register_friction",
    "save",
    "violations",
]
