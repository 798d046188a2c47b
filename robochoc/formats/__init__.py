"""Read and write robots and teams as XML files. All errors in the files are reported together.

docs/reference/format.md; the paper, Figure 2.
"""

from __future__ import annotations

from robochoc.formats.definitions import PREDEFINED
from robochoc.formats.diagnostics import Diagnostic, InvalidInputError, encodable, on_one_line
from robochoc.formats.robot_reader import read_robot, read_robot_again, robot_in
from robochoc.formats.team_reader import find_teams, read_team, robot_names
from robochoc.formats.validation import check_event, check_robot, check_team, with_checked_events
from robochoc.system.files import write_atomically
from robochoc.system.lazy_names import lazy_names

TYPE_CHECKING = False  # start-up: `typing` and the writers are imported on first use
if TYPE_CHECKING:
    from robochoc.formats.robot_writer import robot_xml
    from robochoc.formats.team_writer import write_team

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

_WRITERS = {"robot_xml": "robochoc.formats.robot_writer", "write_team": "robochoc.formats.team_writer"}
__getattr__ = lazy_names(__name__, _WRITERS)[0]
