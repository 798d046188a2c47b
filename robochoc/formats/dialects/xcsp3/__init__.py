"""XCSP3 (https://xcsp.org): instances of CSP and COP in the competition's format, read and written."""

from __future__ import annotations

from robochoc.formats.dialects.dialect import Dialect, ExportOptions, ExportResult
from robochoc.formats.dialects.xcsp3.document import recognises
from robochoc.formats.dialects.xcsp3.reader import NAME, read
from robochoc.model.problem import Team


def write(team: Team, options: ExportOptions) -> ExportResult:
    """Return the team's problem as one XCSP3 file. See `robochoc.formats.dialects.xcsp3.writer`."""
    del options
    from robochoc.formats.dialects.xcsp3.writer import xcsp3  # noqa: PLC0415 - start-up: the solver's process writes it

    return ExportResult({f"{team.name}.xml": xcsp3(team)})


DIALECT = Dialect(NAME, "XCSP3", recognises, read, write)
