"""What `robochoc master`, `robot` and `directory` have in common: places, and failures of runs across machines."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from robochoc.cli.reports.failures import INVALID, LIMIT, LOST, USAGE, Failure, failures_told

if TYPE_CHECKING:
    from robochoc.run.networked.address import Address

_EXTRA = {"cryptography", "zenoh"}


class PlaceType(click.ParamType["Address"]):
    """`HOST:PORT` of a master."""

    name = "place"

    def convert(self, value: str | Address, param: click.Parameter | None, ctx: click.Context | None) -> Address:
        """The place. Fails, as wrong usage, where it is none."""
        from robochoc.run.networked.address import Address, AddressError

        if isinstance(value, Address):
            return value
        try:
            return Address.parse(value)
        except AddressError as bad:
            self.fail(str(bad), param, ctx)


@contextmanager
def network_failures_told(place: object) -> Iterator[None]:
    """Whatever ends a run across machines becomes one line, and an exit status."""
    try:
        from robochoc.authority.authority import InvalidNameError
        from robochoc.authority.certificates import HostNameError
        from robochoc.authority.enrolment import EnrolmentError
        from robochoc.authority.identity import IdentityError
        from robochoc.authority.registry import AuthorityError
        from robochoc.authority.token import TokenError
        from robochoc.communication.network.router import RouterError
        from robochoc.communication.network.transport import CannotConnectError
        from robochoc.run.networked.consult import NoAnswerError, TemplateError
        from robochoc.run.networked.lead import TeamIncompleteError
    except ModuleNotFoundError as missing:
        package = (missing.name or "").partition(".")[0]
        if package not in _EXTRA:
            raise
        message = f"this needs {package}, which is an extra; say: pip install 'robochoc[network]'"
        raise Failure(USAGE, message) from missing
    from robochoc.formats import on_one_line

    statuses: dict[int, tuple[type[Exception], ...]] = {
        INVALID: (IdentityError, AuthorityError, TokenError),
        USAGE: (HostNameError, InvalidNameError, RouterError, TemplateError),
        LIMIT: (TeamIncompleteError,),
        LOST: (CannotConnectError, EnrolmentError, NoAnswerError),
    }
    with failures_told(place):
        try:
            yield
        except tuple(kind for kinds in statuses.values() for kind in kinds) as error:
            status = next(status for status, kinds in statuses.items() if isinstance(error, kinds))
            raise Failure(status, on_one_line(str(error))) from error
