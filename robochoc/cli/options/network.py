"""Addresses, tokens, other options, and errors shared by `robochoc master`, `robot`, `sniff` and `directory`."""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar

import click
from click.core import ParameterSource

from robochoc.cli.options.paths import InputPath
from robochoc.cli.options.value_types import Number
from robochoc.cli.reports.failures import INVALID, LIMIT, LOST, USAGE, Failure, errors_as_failures

if TYPE_CHECKING:
    from robochoc.run.networked.address import Address

Command = TypeVar("Command", bound=Callable[..., object])
_EXTRA = {"cryptography", "zenoh"}
STDIN = "-"
LONGEST = 4096
"""The maximum number of bytes read for a token, which has about a hundred."""
_FILE = "robochoc.token_file"


class AddressType(click.ParamType["Address"]):
    """The address `HOST:PORT` of a master."""

    name = "address"

    def convert(self, value: str | Address, param: click.Parameter | None, ctx: click.Context | None) -> Address:
        """Return the address."""
        from robochoc.run.networked.address import Address, AddressError

        if isinstance(value, Address):
            return value
        try:
            return Address.parse(value)
        except AddressError as bad:
            self.fail(str(bad), param, ctx)


class AddressList(click.ParamType["tuple[Address, ...]"]):
    """Addresses `HOST:PORT` of masters, separated by commas."""

    name = "addresses"

    def convert(
        self, value: str | tuple[Address, ...], param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[Address, ...]:
        """Return the addresses."""
        from robochoc.run.networked.address import Address, AddressError

        if isinstance(value, tuple):
            return value
        try:
            return Address.parse_all(value)
        except AddressError as bad:
            self.fail(str(bad), param, ctx)


def _joined(
    _context: click.Context, param: click.Parameter, value: tuple[tuple[Address, ...], ...]
) -> tuple[Address, ...]:
    """Return all addresses. The same address twice is rejected."""
    from robochoc.run.networked.address import AddressError, check_different

    places = tuple(place for places in value for place in places)
    try:
        check_different(places)
    except AddressError as repeated:
        raise click.BadParameter(str(repeated), param=param) from None
    return places


def masters_option(name: str, argument: str, text: str, *, required: bool) -> Callable[[Command], Command]:
    """Return the repeatable option `name`, with addresses of masters, stored in `argument`, with the help `text`."""
    return click.option(
        name,
        argument,
        type=AddressList(),
        required=required,
        multiple=True,
        callback=_joined,
        metavar="HOST:PORT[,...]",
        help=text,
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
    help="Folder with your key and certificate.  [default: robochoc/identities/NAME in your data folder]",
)


def patience_option(text: str, default_s: float, name: str = "patience_s") -> Callable[[Command], Command]:
    """Return the option `--patience SECONDS`, stored in the argument `name`, with the help text `text`."""
    return click.option(
        "--patience",
        name,
        type=Number(0, min_open=True),
        default=default_s,
        show_default=True,
        metavar="SECONDS",
        help=text,
    )


def token_options() -> Callable[[Command], Command]:
    """Return the options `--token` and `--token-file`, which are both stored in the argument `token`.

    While the command runs, every user of the machine can read a token on the command line in the list of processes.
    """
    options = (
        click.option(
            "--token-file",
            is_eager=True,
            expose_value=False,
            callback=_note_file,
            metavar="FILE",
            help="Enrol with the token in FILE, which only you may read; - is standard input.",
        ),
        click.option(
            "--token",
            envvar="ROBOCHOC_TOKEN",
            callback=_token,
            metavar="TOKEN",
            help="Enrol with this token. Other users see it in the list of processes.",
        ),
    )

    def with_options(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return with_options


def _note_file(context: click.Context, _param: click.Parameter, value: str | None) -> None:
    context.meta[_FILE] = value


def _token(context: click.Context, param: click.Parameter, value: str | None) -> str | None:
    file = context.meta.get(_FILE)
    if file is None:
        return _from_standard_input() if value == STDIN else value
    if param.name and context.get_parameter_source(param.name) is ParameterSource.COMMANDLINE:
        raise click.UsageError("--token and --token-file both give the token; remove one")
    return _from_standard_input() if file == STDIN else _from_file(file)


def _from_standard_input() -> str:
    if sys.stdin.isatty():
        return str(click.prompt("Token", hide_input=True, err=True))
    return _only_word(sys.stdin.buffer.readline(LONGEST + 1), "standard input")


def _from_file(path: str) -> str:
    """Return the token in a file. Files that other users may read are rejected, as ssh does with keys."""
    try:
        with open(path, "rb") as file:  # noqa: PTH123 - the file that is checked is the file that is read
            status = os.fstat(file.fileno())
            if stat.S_ISREG(status.st_mode) and status.st_uid == os.getuid() and status.st_mode & 0o077:
                others = f"others may read it (mode {stat.S_IMODE(status.st_mode):03o})"
                raise Failure(INVALID, f"{path}: {others} and use the token; run: chmod 600 {path}")
            return _only_word(file.read(LONGEST + 1), path)
    except OSError as error:
        raise Failure(INVALID, f"{path}: {error.strerror or error} (give the file with the token)") from error


def _only_word(content: bytes, place: str) -> str:
    """Return the token on a line, after an optional name, as printed by `robochoc authority enrol`."""
    words = content.decode(errors="replace").split()
    if len(content) > LONGEST or len(words) not in {1, 2}:
        found = "no token" if not words else "more than one token"
        raise Failure(INVALID, f"{place}: {found} (expected one line of 'robochoc authority enrol')")
    return words[-1]


@contextmanager
def network_errors_as_failures(place: object) -> Iterator[None]:
    """Convert each foreseen error in a run on several machines to a `Failure` with one line and an exit status."""
    statuses = _statuses()
    from robochoc.formats import on_one_line

    with errors_as_failures(place):
        try:
            yield
        except tuple(kind for kinds in statuses.values() for kind in kinds) as error:
            status = next(status for status, kinds in statuses.items() if isinstance(error, kinds))
            raise Failure(status, on_one_line(str(error))) from error


def _statuses() -> dict[int, tuple[type[Exception], ...]]:
    """Return the exceptions for each exit status. Raises `Failure` if a package of the extra is missing."""
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
        from robochoc.run.networked.standby import NoLeaderError
    except ModuleNotFoundError as missing:
        package = (missing.name or "").partition(".")[0]
        if package not in _EXTRA:
            raise
        message = f"this command requires {package}, which is an extra; run: pip install 'robochoc[network]'"
        raise Failure(USAGE, message) from missing
    return {
        INVALID: (IdentityError, AuthorityError, TokenError),
        USAGE: (HostNameError, InvalidNameError, RouterError, TemplateError),
        LIMIT: (NoLeaderError, TeamIncompleteError),
        LOST: (CannotConnectError, EnrolmentError, NoAnswerError),
    }
