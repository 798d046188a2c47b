"""Lists of robots and tasks, as teams or as mistakes."""

from __future__ import annotations

from pathlib import Path

import pytest

from robochoc.formats import InvalidInputError
from robochoc.formats.dialects.dialect import ImportOptions, ImportResult
from robochoc.formats.dialects.registry import read_foreign

LIST = """robots:
  ann: {at: [0, 0], skills: [camera, gripper], capacity: 3}
  bob: {at: [8, 1], skills: [camera], most: 2}
  cid: {at: [4, 6], skills: [gripper], capacity: 2}
tasks:
  survey: {at: [1, 2], needs: camera, worth: 10}
  inspect: {at: [7, 3], needs: camera, worth: 9, deadline: 5}
  fetch: {at: [3, 4], needs: gripper, worth: 12, load: 2}
  carry: {at: [5, 5], needs: gripper, worth: 20, robots: 2}
  paint: {needs: brush, worth: 50}
synergies:
  - {tasks: [survey, inspect], worth: 2}
distance: streets
"""


def imported(text: str, folder: Path, infinity: int | None = None) -> ImportResult:
    path = folder / "tasks.yaml"
    path.write_text(text)
    return read_foreign([path], ImportOptions(infinity=infinity))


def mistakes(text: str, folder: Path) -> str:
    with pytest.raises(InvalidInputError) as caught:
        imported(text, folder)
    return str(caught.value).replace(f"{folder / 'tasks.yaml'}:", "")
