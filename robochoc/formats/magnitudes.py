"""Check that the constraints of a team compute no numbers that are too large (docs/reference/format.md)."""

from __future__ import annotations

from collections.abc import Iterator

from robochoc.formats.diagnostics import Diagnostic
from robochoc.formats.team_members import TeamMembers
from robochoc.model.magnitudes import MagnitudeError, Magnitudes


def excessive_numbers(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield constraints whose expressions may reach numbers that are too large."""
    domains = {variable.name: variable.domain for robot in members.robots for variable in robot.variables}
    magnitudes = Magnitudes(domains, max((robot.costs.places for robot in members.robots), default=0))
    for member in members.files.values():
        for constraint in member.robot.constraints():
            try:
                magnitudes.check(constraint)
            except MagnitudeError as error:
                yield member.places.constraint(constraint).mistake(error.message, error.hint)
