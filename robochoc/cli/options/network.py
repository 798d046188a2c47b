"""What `robochoc master`, `robot` and `directory` have in common: places, and failures of runs across machines."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from robochoc.cli.reports.failures import INVALID, LIMIT, LOST, USAGE, Failure, failures_told

if TYPE_CHECKING:
    from robochoc.run.networked.address import Place

_EXTRA = {"cryptography", "zenoh"}


class PlaceType(click.ParamType["Place"]):
    """`HOST:PORT` of a master."""

    name = "place"

    def convert(self, value: str | Place, param: click.Parameter | None, ctx: click.Context | None) -> Place:
        """The place. Fails, as wrong usage, where it is none."""
        from robochoc.run.networked.address import BadPlace, Place

        if isinstance(value, Place):
            return value
        try:
            return Place.parse(value)
        except BadPlace as bad:
            self.fail(str(bad), param, ctx)


@contextmanager
def network_failures_told(place: object) -> Iterator[None]:
    """Whatever ends a run across machines becomes one line, and an exit status."""
    try:
        from robochoc.authority.authority import BadName
        from robochoc.authority.certificates import BadHost
        from robochoc.authority.enrolment import EnrolmentFailed
        from robochoc.authority.identity import BadIdentity
        from robochoc.authority.registry import BadAuthority
        from robochoc.authority.token import BadToken
        from robochoc.communication.network.router import RouterFailed
        from robochoc.communication.network.transport import CannotConnect
        from robochoc.run.networked.consult import BadTemplate, NoAnswer
        from robochoc.run.networked.lead import NotComplete
    except ModuleNotFoundError as missing:
        package = (missing.name or "").partition(".")[0]
        if package not in _EXTRA:
            raise
        message = f"this needs {package}, which is an extra; say: pip install 'robochoc[network]'"
        raise Failure(USAGE, message) from missing
    from robochoc.formats import on_one_line

    statuses: dict[int, tuple[type[Exception], ...]] = {
        INVALID: (BadIdentity, BadAuthority, BadToken),
        USAGE: (BadHost, BadName, RouterFailed, BadTemplate),
        LIMIT: (NotComplete,),
        LOST: (CannotConnect, EnrolmentFailed, NoAnswer),
    }
    with failures_told(place):
        try:
            yield
        except tuple(kind for kinds in statuses.values() for kind in kinds) as error:
            status = next(status for status, kinds in statuses.items() if isinstance(error, kinds))
            raise Failure(status, on_one_line(str(error))) from error
