"""`robochoc authority`: enrolment of robots and observers in runs on several machines."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.network import authority_option
from robochoc.cli.options.paths import TeamFolder
from robochoc.cli.reports.failures import INVALID, USAGE, Failure, invalid_input_fails

if TYPE_CHECKING:
    from robochoc.authority.authority import Authority

_LONGEST_TTL_HOURS = 24 * 366


def _lasting(_context: click.Context, _parameter: click.Parameter, hours: float) -> float:
    if not 0 < hours <= _LONGEST_TTL_HOURS:  # neither is it true of NaN, which click's own range lets pass
        raise click.BadParameter(f"{hours:g} is not more than 0 and at most {_LONGEST_TTL_HOURS} (a year).")
    return hours


@click.group()
def authority() -> None:
    """Manage the Authority, which enrols robots and observers and certifies their keys.

    Its folder holds the key that signs all certificates. Keep it on the master's machine only
    (docs/guides/security.md).

    \b
    robochoc authority init
    robochoc authority enrol Robot1.1 Robot1.2
    robochoc authority list
    robochoc authority revoke Robot1.2
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are


@authority.command(short_help="Create an Authority.")
@authority_option
def init(folder: Path | None) -> None:
    """Create an Authority: a key and a certificate for ten years."""
    with _failures_told():
        from robochoc.authority.authority import Authority, default_authority_folder

        made = Authority.create(folder or default_authority_folder())
        until = made.certificate.not_valid_after_utc
        click.echo(f"{made.folder}: a new Authority, until {until:%Y-%m-%d}; next: robochoc authority enrol NAME")


@authority.command(short_help="Enrol robots or observers: one token per name.")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--team", type=TeamFolder(), metavar="DIR", help="Enrol all robots of this team.")
@click.option(
    "--role",
    type=click.Choice(["robot", "observer"]),
    default="robot",
    show_default=True,
    help="Role of the names.",
)
@click.option(
    "--may",
    type=click.Choice(["sniff"]),
    multiple=True,
    metavar="sniff",
    help="Allow them to follow runs (robochoc sniff). Without it, the right is taken away.",
)
@click.option(
    "--token-ttl",
    "hours",
    type=float,
    default=24,
    callback=_lasting,
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
    may: tuple[str, ...],
    hours: float,
) -> None:
    """Create a token for each NAME, and print one line per name.

    Copy each token to its robot. It can be used once. Enrol a name again if its robot has lost its key or was revoked:
    when the new token is used, the earlier certificates are revoked. The role and the rights change at once.
    """
    if team:
        from robochoc.formats import robot_names

        names = (*names, *robot_names(team))
    if not names:
        raise Failure(USAGE, "no names to enrol: give names, or --team DIR")
    with _failures_told(), _opened(folder) as found:
        from robochoc.authority.registry import Right, Role

        tokens = found.enrol_all(names, Role(role), timedelta(hours=hours), map(Right, may))
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
    revoked    is refused
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are
    with _failures_told(), _opened(folder) as found:
        from robochoc.cli.reports.authority import members_json, print_members

        members, now = found.members(), found.clock()
    if as_json:
        click.echo(members_json(members, now), nl=False)
    elif members:
        print_members(members, now)
    else:
        click.echo("no names are enrolled; next: robochoc authority enrol NAME")


@authority.command(short_help="Revoke a name, at once.")
@click.argument("name")
@authority_option
def revoke(name: str, folder: Path | None) -> None:
    """Revoke the certificates of NAME, and its token if it is not used yet.

    A running master notices it. To accept the name again, enrol it again.
    """
    with _failures_told(), _opened(folder) as found:
        found.revoke(name)
    click.echo(f"{name} is revoked; to accept it again: robochoc authority enrol {name}")


@contextmanager
def _opened(folder: Path | None) -> Iterator[Authority]:
    from robochoc.authority.authority import Authority, default_authority_folder

    yield Authority.open(folder or default_authority_folder())


@contextmanager
def _failures_told() -> Iterator[None]:
    """Turn the Authority's errors into `Failure`: one line and an exit status."""
    try:
        from robochoc.authority.names import InvalidNameError, UnknownNameError
        from robochoc.authority.registry import AuthorityError
    except ModuleNotFoundError as missing:
        if missing.name is None or missing.name.partition(".")[0] != "cryptography":
            raise
        raise Failure(USAGE, "the Authority needs 'cryptography'; say: pip install 'robochoc[network]'") from missing
    from robochoc.formats import on_one_line

    try:
        yield
    except (InvalidNameError, UnknownNameError) as error:
        raise Failure(USAGE, on_one_line(str(error))) from error
    except AuthorityError as error:
        raise Failure(INVALID, on_one_line(str(error))) from error
