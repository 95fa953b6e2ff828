"""Drives whose parameter files friso reads and writes."""

from friso.drives.drive import DriveFormat
from friso.drives.formats.cascade import Acs, Ecmc, Twincat
from friso.drives.formats.linuxcnc import Linuxcnc
from friso.drives.formats.odrive import Odrive
from friso.drives.formats.pid import Icub, Kflop, Moteus

TABLE: dict[str, tuple[DriveFormat, str]] = {
    "acs": (Acs(), "ACS SPiiPlus program with the variables of an axis"),
    "ecmc": (Ecmc(), "ecmc axis (YAML, or IOC commands of a motor)"),
    "icub": (Icub(), "iCub motor control file (XML)"),
    "kflop": (Kflop(), "KFLOP initialisation program in C (Dynomotion KMotion)"),
    "linuxcnc": (Linuxcnc(), "LinuxCNC INI file"),
    "moteus": (Moteus(), "moteus configuration (moteus_tool --dump-config)"),
    "odrive": (Odrive(), "ODrive configuration (odrivetool backup-config)"),
    "twincat": (Twincat(), "TwinCAT NC axis (.xti)"),
}
"""Drives and their lines in `friso export --help`, by name."""
