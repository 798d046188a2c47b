"""Options that `robochoc solve` and `robochoc master` share, and how those of `solve` are parsed."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import click

from robochoc.cli.options.names import ProtocolName
from robochoc.cli.options.order import GIVEN
from robochoc.cli.options.ros import RosOptions
from robochoc.cli.options.sections import SectionedCommand
from robochoc.cli.reports.live_sniffer import Watching
from robochoc.run.defaults import MINIMISES, SATISFIES

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
    words = f"The protocol, as 'robochoc protocols' lists them{alone}.  [default: {SATISFIES}; with costs {MINIMISES}]"
    return click.option("--protocol", type=ProtocolName(), metavar="NAME", help=words)


settings_option = click.option(
    "--set",
    "settings_given",
    multiple=True,
    metavar="NAME=VALUE",
    help="Set a parameter of the protocol; 'robochoc protocols NAME' lists them. Repeatable.",
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
messages_option = click.option(
    "--messages",
    type=click.IntRange(1),
    metavar="N",
    help="Stop after about N messages (unknown, status 3).",
)
filter_option = click.option(
    "--filter",
    "filters",
    multiple=True,
    metavar="NAME",
    help="Network: pass all messages through this filter: signed, sealed or an installed one. Repeatable, in order.",
)


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
    """Whether `word` can be patterns of robots' names, and not the next option, or the path of a team."""
    return bool(word) and not word.startswith("-") and "/" not in word and not Path(word).exists()


@dataclass(frozen=True)
class Products:
    """What is made of a run besides what is printed."""

    html: Path | None
    journal: Path | None
    serve: bool
    watching: Watching | None = None

    def __bool__(self) -> bool:
        return bool(self.html or self.journal or self.serve or self.watching)


@dataclass(frozen=True)
class Wanted:
    """What is asked for of each team: the protocol (None: by its kind), the order, how it is told, and where."""

    protocol: str | None
    order: str | Path
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


def check_settings(settings: dict[str, Any]) -> None:
    """Options that would be ignored are wrong usage."""
    _check_simulated(settings)
    if settings["timeout"] is not None and not settings["timeout"] > 0:
        raise click.UsageError("--timeout takes a number of seconds")
    if settings["protocol"] == "central":
        _check_central(settings)
    elif settings["count"]:
        raise click.UsageError("--count is for --protocol central")
    _check_processes(settings)


def _check_simulated(settings: dict[str, Any]) -> None:
    """How long messages take is for the simulator alone, and to be said in one way."""
    simulated = settings["runtime"] == "simulator"
    scheduled = settings["delay"] or settings["schedule"] != "concurrent"
    if settings["channel"] and not simulated:
        raise click.UsageError("--channel is the simulator's; add --runtime simulator")
    if settings["channel"] and scheduled:
        raise click.UsageError("--channel says how long messages take; drop --delay and --schedule random")
    if scheduled and not simulated:
        raise click.UsageError("--delay and --schedule are the simulator's; add --runtime simulator")
    if settings["delay"] and settings["schedule"] != "concurrent":
        raise click.UsageError("--delay is for --schedule concurrent: in a random one any message may take any time")


def _check_processes(settings: dict[str, Any]) -> None:
    """What only robots with processes can do, or only those on a network."""
    runtime = settings["runtime"]
    if settings["filters"] and runtime != "network":
        raise click.UsageError("--filter is for messages that cross a network; add --runtime network")
    if settings["spares"] and runtime == "network":
        raise click.UsageError("--spare starts processes of this machine again; drop --runtime network")
    if (settings["on_loss"] or settings["spares"]) and runtime == "simulator":
        raise click.UsageError(
            "--on-loss and --spare are for processes, which can die; drop --runtime simulator, or write a scenario.xml"
        )
    if settings["spares"] and settings["on_loss"] == "fail":
        raise click.UsageError("--spare brings robots back that died; --on-loss fail ends the run instead")


def _check_central(settings: dict[str, Any]) -> None:
    """There are no robots, and no second opinion."""
    if settings["verify"]:
        raise click.UsageError("--verify asks the central judge, which is --protocol central itself")
    asked = {name: settings[name] for name in ("messages", "on_loss", "spares", "channel", "filters")}
    asked["order"] = settings["order"] != GIVEN
    asked["set"] = settings["settings_given"]
    for name, value in asked.items():
        if value:
            option = "--" + name.removesuffix("s" if name in {"spares", "filters"} else "").replace("_", "-")
            raise click.UsageError(f"{option} is for robots that solve it together, not for --protocol central")
