"""Read and write robots and teams as XML files. All errors in the files are reported together.

docs/reference/format.md; the paper, Figure 2.
"""

from robochoc.formats.definitions import PREDEFINED
from robochoc.formats.diagnostics import Diagnostic, InvalidInputError, encodable, on_one_line
from robochoc.formats.robot_reader import read_robot, read_robot_again, robot_in
from robochoc.formats.robot_writer import robot_xml
from robochoc.formats.team_reader import find_teams, read_team, robot_names
from robochoc.formats.team_writer import write_team
from robochoc.formats.validation import check_event, check_robot, check_team, with_checked_events
from robochoc.system.files import write_atomically

__all__ = [
    "PREDEFINED",
    "Diagnostic",
    "InvalidInputError",
    "check_event",
    "check_robot",
    "check_team",
    "encodable",
    "find_teams",
    "on_one_line",
    "read_robot",
    "read_robot_again",
    "read_team",
    "robot_in",
    "robot_names",
    "robot_xml",
    "with_checked_events",
    "write_atomically",
    "write_team",
]
