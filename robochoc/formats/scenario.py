"""`scenario.xml`: how a team's problem changes over time (FORMAT.md, "Changes over time")."""

from __future__ import annotations

import os
from pathlib import Path

from robochoc.formats.diagnostics import Report, shortened
from robochoc.formats.xml import attribute, line, read_xml

SCENARIO = "scenario.xml"
"""The one XML file in a team's folder that is no robot."""


def check_scenario(folder: Path) -> bool:
    """Whether the team in `folder` has a scenario. Raises `InvalidInput` when it is not valid.

    It must be valid by its schema, and the files of added robots must lie in the team's folder or below.
    """
    path = folder / SCENARIO
    if not os.path.lexists(path):
        return False
    scenario = read_xml(path, "scenario")
    report = Report(str(path))
    inside = folder.resolve()
    for element in scenario.iterfind("event/add_agent"):
        name = attribute(element, "file")
        try:
            added = (inside / name).resolve()
            there = added.is_file()
        except (OSError, ValueError):
            added, there = inside, False
        if not added.is_relative_to(inside):
            report.add(line(element), f"the file '{shortened(name)}' lies outside the team's folder", "move it inside")
        elif not there:
            report.add(
                line(element), f"there is no file '{shortened(name)}' in the team's folder", "write late/NAME.xml"
            )
    report.finish()
    return True
