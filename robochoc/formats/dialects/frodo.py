"""FRODO's XCSP 2.1 (`format="XCSP 2.1_FRODO"`), in one file or in one for each agent, and plain XCSP 2.0 and 2.1.

Facts: FRODO's manual, Appendix A, and its schemas; Roussel and Lecoutre, arXiv 0902.2362.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from robochoc.formats.dialects.dialect import Dialect, Imported, ImportOptions
from robochoc.formats.dialects.xcsp21.frodo_file import frodo_file
from robochoc.formats.dialects.xcsp21.instance import Instance
from robochoc.formats.dialects.xcsp21.merging import merged
from robochoc.formats.dialects.xcsp21.reader import PUBLIC, read_instance
from robochoc.formats.dialects.xcsp21.recognition import Beginning
from robochoc.formats.dialects.xcsp21.team import as_team
from robochoc.formats.element_view import ElementView

NAME = "frodo"

_SELF = re.compile(rb"<agents\s[^>]*\bself\s*=")


def _recognises(_path: Path, beginning: bytes) -> bool:
    found = Beginning(beginning)
    if not found.is_instance or "XDisCSP" in found.format:
        return False
    return found.format.startswith("XCSP 2") or (not found.format and found.has_agents) or found.is_network


def _is_part(_path: Path, beginning: bytes) -> bool:
    return _SELF.search(beginning) is not None


def _read(paths: Sequence[Path], options: ImportOptions) -> Imported:
    instances = [read_instance(path, options, _knower) for path in paths]
    whole = merged(instances)
    whole.name = paths[0].stem if len(paths) == 1 else paths[0].absolute().parent.name
    return as_team(whole, NAME, options)


def _knower(element: ElementView, _instance: Instance) -> str:
    agent = element.attribute("agent")
    return "" if agent == PUBLIC else agent


DIALECT = Dialect(NAME, "FRODO's XCSP 2.1", _recognises, _read, frodo_file, is_part=_is_part)
