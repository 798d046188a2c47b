"""Options, addresses and failures that `robochoc master`, `robot`, `sniff` and `directory` share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar

import click

from robochoc.cli.options.numbers import Number
from robochoc.cli.options.paths import InputPath
from robochoc.cli.reports.failures import INVALID, LIMIT, LOST, USAGE, Failure, failures_told

if TYPE_CHECKING:
    from robochoc.run.networked.address import Address

Command = TypeVar("Command", bound=Callable[..., object])
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


master_option = click.option(
    "--master", "place", type=PlaceType(), required=True, metavar="HOST:PORT", help="Address of the master."
)
authority_option = click.option(
    "--authority",
    "folder",
    type=InputPath(),
    metavar="DIR",
    help="Folder of the Authority.  [default: robochoc/authority in your data folder]",
)
identity_option = click.option(
    "--identity",
    type=InputPath(),
    metavar="DIR",
    help="Folder of the key and the certificate.  [default: robochoc/identities/NAME in your data folder]",
)


def patience_option(text: str, default_s: float, name: str = "patience_s") -> Callable[[Command], Command]:
    """Return the option `--patience SECONDS`, as the argument `name`, explained by `text`."""
    return click.option(
        "--patience",
        name,
        type=Number(0, min_open=True),
        default=default_s,
        show_default=True,
        metavar="SECONDS",
        help=text,
    )


@contextmanager
def network_failures_told(place: object) -> Iterator[None]:
    """Turn each failure of a run across machines into a message of one line and an exit status."""
    statuses = _statuses()
    from robochoc.formats import on_one_line

    with failures_told(place):
        try:
            yield
        except tuple(kind for kinds in statuses.values() for kind in kinds) as error:
            status = next(status for status, kinds in statuses.items() if isinstance(error, kinds))
            raise Failure(status, on_one_line(str(error))) from error


def _statuses() -> dict[int, tuple[type[Exception], ...]]:
    """Return the exceptions of each exit status. Raise `Failure` where a package of the extra is missing."""
    try:
        from robochoc.authority.certificates import HostNameError
        from robochoc.authority.enrolment import EnrolmentError
        from robochoc.authority.identity import IdentityError
        from robochoc.authority.names import InvalidNameError
        from robochoc.authority.registry import AuthorityError
        from robochoc.authority.token import TokenError
        from robochoc.communication.network.router import RouterError
        from robochoc.communication.network.transport import CannotConnectError
        from robochoc.run.networked.directory_query import NoAnswerError, TemplateError
        from robochoc.run.networked.master_run import TeamIncompleteError
    except ModuleNotFoundError as missing:
        package = (missing.name or "").partition(".")[0]
        if package not in _EXTRA:
            raise
        message = f"this needs {package}, which is an extra; say: pip install 'robochoc[network]'"
        raise Failure(USAGE, message) from missing
    return {
        INVALID: (IdentityError, AuthorityError, TokenError),
        USAGE: (HostNameError, InvalidNameError, RouterError, TemplateError),
        LIMIT: (TeamIncompleteError,),
        LOST: (CannotConnectError, EnrolmentError, NoAnswerError),
    }
