"""Options that `robochoc solve` and `robochoc master` share, and how those of `solve` are parsed."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from robochoc.cli.options.channel import channel_for
from robochoc.cli.options.local_problems import limits
from robochoc.cli.options.names import ProtocolName
from robochoc.cli.options.numbers import Number, WholeNumber
from robochoc.cli.options.order import GIVEN
from robochoc.cli.options.ros import RosOptions
from robochoc.cli.options.sections import SectionedCommand
from robochoc.cli.reports.failures import failures_told
from robochoc.cli.reports.live_sniffer import Watching
from robochoc.communication.kill_schedule import Kill
from robochoc.run.defaults import AUTO

if TYPE_CHECKING:
    from robochoc.run.options import Options

Command = TypeVar("Command", bound=Callable[..., object])
WITHDRAWALS = ("minimum", "maximal")
_FORMER = {"fewest": "minimum"}
"""Spellings of earlier versions."""


class WithdrawalName(click.Choice[str]):
    """A name in `WITHDRAWALS`, or what an earlier version called it."""

    def __init__(self) -> None:
        super().__init__(WITHDRAWALS)

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the name. Fail, as wrong usage, where it is none."""
        return super().convert(_FORMER.get(value, value), param, ctx)


def protocol_option(*, central: bool) -> Callable[[Command], Command]:
    """Return the option `--protocol NAME`; `central` says that there may also be no protocol, but one model."""
    alone = "; central: no robots, one model of all files" if central else ""
    words = f"The protocol, as 'robochoc protocols' lists them; auto: one that suits the team{alone}."
    return click.option("--protocol", type=ProtocolName(), default=AUTO, show_default=True, metavar="NAME", help=words)


settings_option = click.option(
    "--set",
    "settings_given",
    multiple=True,
    metavar="NAME=VALUE",
    help="Set a parameter ('robochoc protocols NAME'). Repeatable.",
)
withdraw_option = click.option(
    "--withdraw",
    type=WithdrawalName(),
    metavar="[=KIND]",
    help=(
        "If the team has no solution, withdraw robots. minimum (without a word): as few as possible, by weight, proven;"
        " maximal: nobody can be added, found fast."
    ),
)
deadline_option = click.option(
    "--deadline",
    type=Number(0, min_open=True),
    metavar="SECONDS",
    help="Stop by then with the best solution so far.",
)
preprocess_option = click.option(
    "--preprocess",
    type=click.Choice(["ac"]),
    metavar="ac",
    help="First make domains arc consistent: ac.",
)
messages_option = click.option(
    "--messages",
    type=WholeNumber(1),
    metavar="N",
    help="Stop after about N messages (unknown, status 3).",
)


class KillType(click.ParamType[Kill]):
    """`ROBOT@SECONDS`."""

    name = "kill"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> Kill:
        """Return the robot and the time. Fail, as wrong usage, where they are none."""
        robot, _, seconds = value.rpartition("@")
        with suppress(ValueError):
            after_s = float(seconds)
            if robot and 0 <= after_s < math.inf:
                return Kill(robot, after_s)
        return self.fail(f"{value!r} is not ROBOT@SECONDS, such as Robot2.6@0.5", param, ctx)


kill_option = click.option(
    "--kill",
    type=KillType(),
    multiple=True,
    metavar="ROBOT@SECONDS",
    help="Kill the robot's process after so long. Repeatable.",
)
filter_option = click.option(
    "--filter",
    "filters",
    multiple=True,
    metavar="NAME",
    help="Network: filters: signed, sealed, others. Repeatable.",
)


_SAME_NAMES = (
    "seed", "timeout", "delay", "count", "verify", "messages", "ncccs", "cycles", "spares", "patience", "filters",
    "kill", "bounds", "message_loss", "deadline", "improve", "runtime", "schedule", "withdraw", "on_loss", "preprocess",
    "central_with",
)  # fmt: skip
"""Arguments of `robochoc solve` that are called as in `robochoc.run.Options`."""


class SolveCommand(SectionedCommand):
    """A command whose `--withdraw`, `--spare` and `--sniff` may stand alone.

    The word after one of them is its value if it fits.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Give an option that stands alone its value."""
        plain = args.index("--") if "--" in args else len(args)
        for place, word in enumerate(args[:plain]):
            following = args[place + 1] if place + 1 < len(args) else ""
            alone = ""
            if word == "--withdraw" and following not in {*WITHDRAWALS, *_FORMER}:
                alone = f"--withdraw={WITHDRAWALS[0]}"
                _check_path(ctx, following, "kind of withdrawal", WITHDRAWALS)
            elif word == "--sniff" and not _names_robots(following):
                alone = "--sniff="
            elif word == "--spare" and not following.isdecimal():
                alone = "--spare=1"
                _check_path(ctx, following, "number of robots", ())
            if alone:
                args = [*args[:place], alone, *args[place + 1 :]]
        return super().parse_args(ctx, args)


def _check_path(ctx: click.Context, word: str, kind: str, values: Sequence[str]) -> None:
    """Raise `click.UsageError` unless `word`, behind an option that may stand alone, is an option or a path.

    Else it is one of the option's `values`, misspelt, and the path that it would be taken for is not there. The shell
    completes words that are not finished: then nothing is checked.
    """
    if ctx.resilient_parsing or not word or word.startswith("-") or os.path.lexists(word):
        return
    hint = f": {' or '.join(values)}" if values else ""
    raise click.UsageError(f"{word!r} is no {kind} and no folder{hint}")


def _names_robots(word: str) -> bool:
    """Return whether `word` can be patterns of robots' names, and not the next option or a team's path."""
    return bool(word) and not word.startswith("-") and "/" not in word and not Path(word).exists()


@dataclass(frozen=True)
class Products:
    """The products of a run besides the printed result."""

    html: Path | None
    journal: Path | None
    serve: bool
    watching: Watching | None = None

    def __bool__(self) -> bool:
        return bool(self.html or self.journal or self.serve or self.watching)


@dataclass(frozen=True)
class Wanted:
    """The request for each team: the order (None: not asked for), how files are read, and what is told."""

    order: str | Path | None
    dialect: str | None
    infinity: int | None
    owner: str | None
    as_json: bool
    explain: bool
    ros: RosOptions


def protocol_settings(given: Iterable[str]) -> dict[str, str]:
    """`NAME=VALUE`, parsed; the last one of a name counts."""
    found = {}
    for word in given:
        name, equals, value = word.partition("=")
        if not equals or not name:
            raise click.UsageError(
                f"--set takes NAME=VALUE, not {word!r}; robochoc protocols NAME shows what can be set"
            )
        found[name] = value
    return found


def options_of(arguments: dict[str, Any], *, environment: bool) -> Options:
    """Take the options of a run out of the arguments of `robochoc solve`.

    Args:
        arguments: the command's arguments; those that are used are taken out, but for protocol and order.
        environment: whether the robots' situation changes the problem.

    Raises:
        click.UsageError: for options that do not go together (`robochoc.run.compatibility.option_rules`).
        Failure: for a channel that cannot be read.
    """
    from robochoc.run.compatibility.option_rules import refuse_options
    from robochoc.solver.encoding import UnsupportedError

    for name in ("timeout", "deadline"):
        if arguments[name] is not None and not arguments[name] > 0:
            raise click.UsageError(f"--{name} takes a number of seconds")
    options = _take_options(arguments)
    try:
        refuse_options(options, environment=environment)
    except UnsupportedError as refused:
        raise click.UsageError(str(refused)) from None
    return options


def _take_options(arguments: dict[str, Any]) -> Options:
    from robochoc.run.options import Options

    with failures_told("--channel"):
        channel = channel_for(arguments.pop("channel"))
    return Options(
        protocol=arguments["protocol"],
        order=() if arguments["order"] not in {None, GIVEN} else None,  # which one, each team's robots say
        local=limits(
            arguments.pop("local_solutions"), arguments.pop("local_timeout"), always_ace=arguments.pop("always_ace")
        ),
        cache=not arguments.pop("no_cache"),
        settings=protocol_settings(arguments.pop("settings_given")),
        channel=channel,
        **{name: arguments.pop(name) for name in _SAME_NAMES},
    )


def check_products(products: Products, wanted: Wanted, options: Options, *, teams: int) -> None:
    """Raise `click.UsageError` for products that would be empty, or that are for one team only."""
    if wanted.explain and wanted.as_json:
        raise click.UsageError(
            "--explain goes without --json: the JSON result always has what was chosen, and the tree"
        )
    if options.count and options.protocol == "central" and (products or wanted.ros):
        nothing = "--ros" if wanted.ros else "--html, --journal, --serve or --sniff"
        raise click.UsageError(f"--count gives only a number: drop {nothing}")
    if options.bounds and not products.journal:
        raise click.UsageError("--bounds is of the journal: add --journal FILE")
    if options.runtime == "arrays" and (products.journal or products.watching):
        raise click.UsageError("--journal and --sniff show messages, and --runtime arrays sends none: drop it")
    if products.serve and products.watching:
        raise click.UsageError("--serve and --sniff both stay until Ctrl-C; the page of --sniff shows the scene, too")
    if wanted.ros and teams > 1:
        raise click.UsageError(f"--ros and --situation are for one team; {teams} were found")
    if products and teams > 1:
        raise click.UsageError(f"--html, --journal, --serve and --sniff are for one team; {teams} were found")
