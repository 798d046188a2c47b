"""`robochoc authority`: who may take part in runs on several machines."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import click

from robochoc.cli.options.paths import InputPath
from robochoc.cli.reports.failures import INVALID, USAGE, Failure, invalid_input_fails

if TYPE_CHECKING:
    from robochoc.authority.authority import Authority

Command = TypeVar("Command", bound=Callable[..., object])
_LONGEST_TTL_HOURS = 24 * 366


def _folder_option(command: Command) -> Command:
    return click.option(
        "--authority",
        "folder",
        type=InputPath(),
        metavar="DIR",
        help="The Authority's folder  [default: robochoc/authority in your data folder]",
    )(command)


def _lasting(_context: click.Context, _parameter: click.Parameter, hours: float) -> float:
    if not 0 < hours <= _LONGEST_TTL_HOURS:  # neither is it true of NaN, which click's own range lets pass
        raise click.BadParameter(f"{hours:g} is not more than 0 and at most {_LONGEST_TTL_HOURS} (a year).")
    return hours


@click.group()
def authority() -> None:
    """The Authority: it says who may take part, and certifies the keys of those who may.

    Its folder holds the key that signs all certificates: whoever has it decides who takes part. Keep it where the
    master runs, and nowhere else. What protects from what: docs/guides/security.md.

    \b
    robochoc authority init
    robochoc authority enrol Robot1.1 Robot1.2
    robochoc authority list
    robochoc authority revoke Robot1.2
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are


@authority.command(short_help="Make an Authority.")
@_folder_option
def init(folder: Path | None) -> None:
    """Make a new Authority: its key, and its certificate, which is valid for ten years."""
    with _failures_told():
        from robochoc.authority.authority import Authority, default_folder

        made = Authority.create(folder or default_folder())
        until = made.certificate.not_valid_after_utc
        click.echo(f"{made.folder}: a new Authority, until {until:%Y-%m-%d}; next: robochoc authority enrol NAME")


@authority.command(short_help="Give names a token each.")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--team", type=InputPath(), metavar="DIR", help="Enrol all robots of this team, by their files' names.")
@click.option(
    "--role",
    type=click.Choice(["robot", "observer"]),
    default="robot",
    show_default=True,
    help="What the names take part as.",
)
@click.option(
    "--may",
    type=click.Choice(["sniff"]),
    multiple=True,
    metavar="sniff",
    help="A right besides: sniff, to follow runs (robochoc sniff). Without it the names do not have it (any more).",
)
@click.option(
    "--token-ttl",
    "hours",
    type=float,
    default=24,
    callback=_lasting,
    show_default=True,
    metavar="HOURS",
    help="So long the tokens work.",
)
@click.option("--json", "as_json", is_flag=True, help="One JSON object a name.")
@_folder_option
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
    """Give each NAME a token, and print both, a line a name.

    Carry each token to its robot: it works once. A name that is enrolled already can be enrolled again, for a robot
    that has lost its key, or was revoked: when it shows the new token, its certificates so far are revoked. Its role
    and its rights change at once.
    """
    if team:
        from robochoc.formats import robot_names

        names = (*names, *robot_names(team))
    if not names:
        raise Failure(USAGE, "nobody to enrol: give names, or --team DIR")
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


@authority.command("list", short_help="Who is enrolled, and how it stands with them.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object a name.")
@_folder_option
def list_members(folder: Path | None, *, as_json: bool) -> None:
    """List all names that were ever enrolled.

    \b
    invited    it has a token, which it has not shown yet
    in force   it has a certificate, and renews it by itself while it runs
    expired    its token or its certificate is too old: enrol it again
    revoked    it is turned away
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are
    with _failures_told(), _opened(folder) as found:
        from robochoc.cli.reports.authority import json_report, print_table

        members, now = found.members(), found.clock()
    if as_json:
        click.echo(json_report(members, now), nl=False)
    elif members:
        print_table(members, now)
    else:
        click.echo("nobody is enrolled; next: robochoc authority enrol NAME")


@authority.command(short_help="Turn a name away, at once.")
@click.argument("name")
@_folder_option
def revoke(name: str, folder: Path | None) -> None:
    """Revoke all that NAME was given: its certificates, and a token it has not shown.

    A master that runs hears of it by itself. To let the name in again, enrol it again.
    """
    with _failures_told(), _opened(folder) as found:
        found.revoke(name)
    click.echo(f"{name} is revoked; to let it in again: robochoc authority enrol {name}")


@contextmanager
def _opened(folder: Path | None) -> Iterator[Authority]:
    from robochoc.authority.authority import Authority, default_folder

    yield Authority.open(folder or default_folder())


@contextmanager
def _failures_told() -> Iterator[None]:
    """Whatever the Authority says no to becomes one line, and an exit status."""
    try:
        from robochoc.authority.authority import InvalidNameError, UnknownNameError
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
