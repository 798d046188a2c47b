"""`robochoc authority`: enrols robots and observers for runs on several machines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.network import authority_option
from robochoc.cli.options.paths import TeamFolder
from robochoc.cli.options.value_types import Number
from robochoc.cli.reports.failures import INVALID, USAGE, Failure, invalid_input_fails

if TYPE_CHECKING:
    from robochoc.authority.authority import Authority
    from robochoc.authority.registry import EnrolledName

_LONGEST_TTL_HOURS = 24 * 366


@click.group()
def authority() -> None:
    """Manage the Authority, which enrols robots and observers and certifies their keys.

    Its folder contains the key that signs all certificates. Store it on the master's machine only
    (documentation, page Security on several machines).

    \b
    robochoc authority init
    robochoc authority enrol Robot1.1 Robot1.2
    robochoc authority list
    robochoc authority revoke Robot1.2
    """  # noqa: D301 - \\b keeps click from wrapping the lines


@authority.command(short_help="Create an Authority.")
@authority_option
def init(folder: Path | None) -> None:
    """Create an Authority: a key, and a certificate that is valid for ten years."""
    with _errors_as_failures():
        from robochoc.authority.authority import Authority, default_authority_folder

        created = Authority.create(folder or default_authority_folder())
        until = created.certificate.not_valid_after_utc
        click.echo(
            f"{created.folder}: a new Authority, valid until {until:%Y-%m-%d}; next: robochoc authority enrol NAME"
        )


@authority.command(short_help="Enrol robots, observers or standby masters: one token per name.")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--team", type=TeamFolder(), metavar="DIR", help="Enrol all robots of this team.")
@click.option(
    "--role",
    type=click.Choice(["robot", "observer", "master"]),
    default="robot",
    show_default=True,
    help="Role of the names. The role master is for standby masters.",
)
@click.option(
    "--host",
    "hosts",
    multiple=True,
    metavar="HOST",
    help="Name or address by which robots reach a standby master. Repeatable.",
)
@click.option(
    "--may",
    type=click.Choice(["sniff"]),
    multiple=True,
    metavar="sniff",
    help="Allow the names to follow runs (robochoc sniff). Without this option, the right is removed.",
)
@click.option(
    "--token-ttl",
    "hours",
    type=Number(0, _LONGEST_TTL_HOURS, min_open=True),
    default=24,
    show_default=True,
    metavar="HOURS",
    help="Lifetime of the tokens.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per name.")
@authority_option
@invalid_input_fails
def enrol(
    names: tuple[str, ...],
    team: Path | None,
    folder: Path | None,
    *,
    as_json: bool,
    role: str,
    hosts: tuple[str, ...],
    may: tuple[str, ...],
    hours: float,
) -> None:
    """Create a token for each NAME, and print one line per name.

    Copy each token to its robot. A token can be used once. Enrol a name again if its robot has lost its key or was
    revoked: when the new token is used, the earlier certificates are revoked. Role and rights change at once.
    """
    if team:
        from robochoc.formats import robot_names

        names = (*names, *robot_names(team))
    if not names:
        raise Failure(USAGE, "there are no names to enrol: give names, or --team DIR")
    with _errors_as_failures(), _opened(folder) as opened:
        from robochoc.authority.registry import Right, Role

        tokens = opened.enrol_all(names, Role(role), timedelta(hours=hours), map(Right, may), hosts)
    if as_json:
        import msgspec

        for name, token in tokens.items():
            line = {"name": name, "role": role, "token": str(token), "hours": hours}
            click.echo(msgspec.json.encode(line).decode())
        return
    for name, token in tokens.items():
        click.echo(f"{name} {token}")


@authority.command("list", short_help="List all names and their state.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per name.")
@authority_option
def list_members(folder: Path | None, *, as_json: bool) -> None:
    """List all names that were ever enrolled.

    \b
    invited    has a token that is not used yet
    in force   has a certificate, and renews it during runs
    expired    token or certificate is too old: enrol the name again
    revoked    is not accepted
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    with _errors_as_failures(), _opened(folder) as opened:
        members, now = opened.members(), opened.clock()
    if as_json:
        _print_json(members, now)
    elif members:
        _print_members(members, now)
    else:
        click.echo("no names are enrolled; next: robochoc authority enrol NAME")


@authority.command(short_help="Revoke a name immediately.")
@click.argument("name")
@authority_option
def revoke(name: str, folder: Path | None) -> None:
    """Revoke the certificates of NAME, and its token if that has not been used yet.

    A running master notices the change. To admit the name again, enrol it again.
    """
    with _errors_as_failures(), _opened(folder) as opened:
        opened.revoke(name)
    click.echo(f"{name} is revoked; to accept it again: robochoc authority enrol {name}")


@contextmanager
def _opened(folder: Path | None) -> Iterator[Authority]:
    from robochoc.authority.authority import Authority, default_authority_folder

    yield Authority.open(folder or default_authority_folder())


@contextmanager
def _errors_as_failures() -> Iterator[None]:
    """Convert the Authority's errors to a `Failure` with one line and an exit status."""
    try:
        from robochoc.authority.certificates import HostNameError
        from robochoc.authority.names import InvalidNameError, NotEnrolledError
        from robochoc.authority.registry import AuthorityError
    except ModuleNotFoundError as missing:
        if missing.name is None or missing.name.partition(".")[0] != "cryptography":
            raise
        message = "the Authority requires 'cryptography'; run: pip install 'robochoc[network]'"
        raise Failure(USAGE, message) from missing
    from robochoc.formats import on_one_line

    try:
        yield
    except (HostNameError, InvalidNameError, NotEnrolledError) as error:
        raise Failure(USAGE, on_one_line(str(error))) from error
    except AuthorityError as error:
        raise Failure(INVALID, on_one_line(str(error))) from error


def _print_json(members: Sequence[EnrolledName], now: float) -> None:
    """Print one JSON object per line: name, role, rights, state at the Unix time `now`, and expiry or null."""
    import msgspec

    for member in members:
        row = {
            "name": member.name,
            "role": member.role,
            "may": member.may,
            "state": member.state(now),
            "expires": _expiry(member, now),
        }
        click.echo(msgspec.json.encode(row))


def _print_members(members: Sequence[EnrolledName], now: float) -> None:
    """Print the name, role, rights, state and expiry (UTC) of each member."""
    from robochoc.cli.reports.table import print_table

    rows = []
    for member in members:
        until = _expiry(member, now)
        expires = f"{until:%Y-%m-%d %H:%M}" if until else "-"
        rows.append((member.name, str(member.role), ", ".join(member.may) or "-", str(member.state(now)), expires))
    print_table(("name", "role", "may", "state", "expires (UTC)"), rows)


def _expiry(member: EnrolledName, now: float) -> datetime | None:
    until = member.expires(now)
    return datetime.fromtimestamp(int(until), UTC) if until else None
