"""Options shared by `robochoc solve` and `robochoc master`, and the parsing of the options of `solve`."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from robochoc.cli.options.local_problems import limits
from robochoc.cli.options.order import GIVEN
from robochoc.cli.options.paths import InputPath
from robochoc.cli.options.ros import RosOptions
from robochoc.cli.options.sections import SectionedCommand
from robochoc.cli.options.value_types import NameOrFile, Number, ProtocolName, WholeNumber
from robochoc.cli.reports.failures import errors_as_failures
from robochoc.cli.reports.live_sniffer import SnifferRequest
from robochoc.communication.kill_schedule import Kill
from robochoc.model.objectives import ObjectivesMode, objectives_mode
from robochoc.run.defaults import AUTO, MOST_STANDBYS
from robochoc.system.lazy_dataclass import dataclass

if TYPE_CHECKING:
    from robochoc.communication.simulator.channel import ChannelModel
    from robochoc.run.options import Options

Command = TypeVar("Command", bound=Callable[..., object])
WITHDRAWALS = ("minimum", "maximal")
_FORMER = {"fewest": "minimum"}
"""The spellings used in earlier versions."""
CHANNEL_NAMES = ("wlan", "wpan", "wman", "wwan")
CHANNEL_TYPE = NameOrFile("channel", CHANNEL_NAMES)


class WithdrawalName(click.Choice[str]):
    """A name in `WITHDRAWALS`, or its spelling in an earlier version."""

    def __init__(self) -> None:
        super().__init__(WITHDRAWALS)

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the name in its current spelling."""
        return super().convert(_FORMER.get(value, value), param, ctx)


def protocol_option(*, central: bool) -> Callable[[Command], Command]:
    """Return the option `--protocol NAME`. With `central`, its help also explains the central solver."""
    alone = "; central: no robots" if central else ""
    words = f"Protocol ('robochoc protocols' lists them); auto: chosen by the problem{alone}."
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
    help="Withdraw robots if needed: minimum (default), maximal.",
)
deadline_option = click.option(
    "--deadline",
    type=Number(0, min_open=True),
    metavar="SECONDS",
    help="Stop after this time with the best solution found.",
)
answer_option = click.option(
    "--answer",
    type=click.Choice(["best", "final"]),
    default="best",
    metavar="KIND",
    help="Answer without a proof: best (default) or final values.",
)
risk_option = click.option(
    "--risk",
    type=click.Choice(["expected", "worst"]),
    default="expected",
    metavar="KIND",
    help="Random variables: expected (default) or worst costs.",
)


class SampleNumber(WholeNumber):
    """A number of samples, whose averages are exact decimals."""

    def __init__(self) -> None:
        super().__init__(1)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:  # noqa: ANN401 - click's signature
        """Return the number, or fail with the next larger valid number."""
        from robochoc.model.sampling import MOST_SAMPLES, sample_number

        self.max = MOST_SAMPLES
        try:
            return sample_number(super().convert(value, param, ctx))
        except ValueError as invalid:
            self.fail(str(invalid), param, ctx)


samples_option = click.option(
    "--samples",
    type=SampleNumber(),
    metavar="N",
    help="Random variables: costs are averages of N samples.",
)
repair_option = click.option(
    "--no-repair",
    "repair",
    is_flag=True,
    flag_value=False,
    default=True,
    help="Do not repair violated hard constraints.",
)
preprocess_option = click.option(
    "--preprocess",
    type=click.Choice(["ac"]),
    metavar="ac",
    help="Before the search, make domains arc consistent: ac.",
)
start_option = click.option(
    "--start",
    type=InputPath(),
    metavar="FILE",
    help="Begin from the assignment in a JSON result or a journal.",
)
cold_option = click.option("--cold", is_flag=True, help="After a change, do not begin from the last answer.")
cluster_option = click.option(
    "--cluster",
    metavar="ADDRESS",
    help="Arrays: address or file of a Dask scheduler.",
)
messages_option = click.option(
    "--messages",
    type=WholeNumber(1),
    metavar="N",
    help="Stop after about N messages (unknown, status 3).",
)


class ObjectivesType(click.ParamType[ObjectivesMode]):
    """A way to combine several objectives: `weighted:NAME=WEIGHT,...`, `lexicographic:NAME,...` or `pareto`."""

    name = "objectives"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> ObjectivesMode:
        """Return the mode in the value."""
        try:
            return objectives_mode(value)
        except ValueError as invalid:
            self.fail(str(invalid), param, ctx)


objectives_option = click.option(
    "--objectives",
    type=ObjectivesType(),
    metavar="MODE",
    help="pareto (default), weighted:A=1,B=3, lexicographic:A,B.",
)


class KillType(click.ParamType[Kill]):
    """A value `ROBOT@SECONDS`."""

    name = "kill"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> Kill:
        """Return the robot and the time in the value."""
        robot, _, seconds = value.rpartition("@")
        with suppress(ValueError):
            after_s = float(seconds)
            if robot and 0 <= after_s < math.inf:
                return Kill(robot, after_s)
        return self.fail(f"{value!r} is not of the form ROBOT@SECONDS, such as Robot2.6@0.5", param, ctx)


kill_option = click.option(
    "--kill",
    type=KillType(),
    multiple=True,
    metavar="ROBOT@SECONDS",
    help="Kill a robot's process at this time. Repeatable.",
)
standby_option = click.option(
    "--standby",
    type=WholeNumber(0, MOST_STANDBYS),
    default=0,
    metavar="N",
    help="Network: start N standby masters, too.",
)
filter_option = click.option(
    "--filter",
    "filters",
    multiple=True,
    metavar="NAME",
    help="Network: signed, sealed or another filter. Repeatable.",
)


_SAME_NAMES = (
    "seed", "timeout", "delay", "count", "verify", "messages", "ncccs", "cycles", "spares", "patience", "filters",
    "kill", "standby", "bounds", "message_loss", "deadline", "improve", "runtime", "schedule", "withdraw", "on_loss",
    "preprocess", "central_with", "cluster", "answer", "risk", "samples", "cold", "repair", "objectives",
)  # fmt: skip
"""The arguments of `robochoc solve` that have the same name in `robochoc.run.Options`."""


class SolveCommand(SectionedCommand):
    """A command in which the value of `--withdraw`, `--spare` and `--sniff` is optional.

    The word after one of these options is its value if it is a valid value.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Add the default value after each of these options that has no value."""
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
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            from robochoc.system.pydcop_words import OPTIONS

            if (name := error.option_name) in OPTIONS:
                text = f"No such option {name!r}: instead of this option of pyDCOP, use {OPTIONS[name]}."
                raise click.UsageError(text, ctx) from None
            raise


def _check_path(ctx: click.Context, word: str, kind: str, values: Sequence[str]) -> None:
    """Raise `click.UsageError` unless `word`, after an option without a value, is an option or an existing path.

    Any other word is probably a misspelt value (`values`), but would be read as a path. Nothing is checked while the
    shell completes an unfinished word.
    """
    if ctx.resilient_parsing or not word or word.startswith("-") or os.path.lexists(word):
        return
    hint = f": {' or '.join(values)}" if values else ""
    raise click.UsageError(f"{word!r} is neither a {kind} nor a folder{hint}")


def _names_robots(word: str) -> bool:
    """Return whether `word` can be patterns of robots' names, instead of the next option or a team's path."""
    return bool(word) and not word.startswith("-") and "/" not in word and not Path(word).exists()


@dataclass(frozen=True)
class Outputs:
    """The outputs of a run in addition to the printed result."""

    html: Path | None
    journal: Path | None
    serve: bool
    sniffer: SnifferRequest | None = None

    def __bool__(self) -> bool:
        return bool(self.html or self.journal or self.serve or self.sniffer)


@dataclass(frozen=True)
class TeamRequest:
    """The options that apply to each team: its order (None: not given), how its files are read, and what is printed.

    `start` is the file with the assignment from which the search begins.
    """

    order: str | Path | None
    dialect: str | None
    infinity: int | None
    owner: str | None
    as_json: bool
    explain: bool
    ros: RosOptions
    start: Path | None = None


def channel_for(channel: str | Path | None) -> ChannelModel | None:
    """Return the channel model with a name or in a file.

    Raises:
        InvalidInputError: if the file is not a valid channel model.
    """
    if channel is None:
        return None
    from robochoc.communication.simulator.channel import CHANNELS, read_channel

    return read_channel(channel) if isinstance(channel, Path) else CHANNELS[channel]


def protocol_settings(given: Iterable[str]) -> dict[str, str]:
    """Parse words `NAME=VALUE`. If a name is repeated, the last value counts."""
    found = {}
    for word in given:
        name, equals, value = word.partition("=")
        if not equals or not name:
            raise click.UsageError(
                f"--set requires NAME=VALUE, not {word!r}; 'robochoc protocols NAME' lists the parameters"
            )
        found[name] = value
    return found


def options_of(arguments: dict[str, Any], *, environment: bool) -> Options:
    """Make the options of a run from the arguments of `robochoc solve`.

    Args:
        arguments: The command's arguments. Those that are used are removed, except the protocol and the order.
        environment: True if the robots' situation changes the problem.

    Raises:
        click.UsageError: if options cannot be combined (`robochoc.run.compatibility.option_rules`).
        Failure: if a channel model cannot be read.
    """
    from robochoc.run.compatibility.option_rules import refuse_options
    from robochoc.solver.errors import UnsupportedError

    options = _pop_options(arguments)
    try:
        refuse_options(options, environment=environment)
    except UnsupportedError as refused:
        raise click.UsageError(str(refused)) from None
    return options


def _pop_options(arguments: dict[str, Any]) -> Options:
    from robochoc.run.options import Options

    with errors_as_failures("--channel"):
        channel = channel_for(arguments.pop("channel"))
    return Options(
        protocol=arguments["protocol"],
        order=() if arguments["order"] not in {None, GIVEN} else None,  # determined for each team later
        local=limits(
            arguments.pop("local_solutions"), arguments.pop("local_timeout"), always_ace=arguments.pop("always_ace")
        ),
        cache=not arguments.pop("no_cache"),
        settings=protocol_settings(arguments.pop("settings_given")),
        channel=channel,
        **{name: arguments.pop(name) for name in _SAME_NAMES},
    )


def check_outputs(outputs: Outputs, request: TeamRequest, options: Options, *, teams: int) -> None:
    """Raise `click.UsageError` for outputs that would be empty, or that are only possible for a single team."""
    if request.explain and request.as_json:
        raise click.UsageError(
            "--explain cannot be used with --json: the JSON result always includes the choice and the tree"
        )
    if options.count and options.protocol == "central" and (outputs or request.ros):
        nothing = "--ros" if request.ros else "--html, --journal, --serve or --sniff"
        raise click.UsageError(f"--count reports only a number: remove {nothing}")
    if request.start and options.protocol == "central":
        raise click.UsageError("--start is for robots, not for --protocol central: remove --start")
    if request.start and teams > 1:
        raise click.UsageError(f"--start accepts one team; {teams} were found")
    if options.bounds and not outputs.journal:
        raise click.UsageError("--bounds writes to the journal: add --journal FILE")
    if outputs.journal or outputs.sniffer:
        _refuse_to_show_messages(options)
    if outputs.serve and outputs.sniffer:
        raise click.UsageError(
            "--serve cannot be used with --sniff: remove --serve, since the page of --sniff also shows the scene"
        )
    if request.ros and teams > 1:
        raise click.UsageError(f"--ros and --situation accept one team; {teams} were found")
    if outputs and teams > 1:
        raise click.UsageError(f"--html, --journal, --serve and --sniff accept one team; {teams} were found")


def _refuse_to_show_messages(options: Options) -> None:
    """Raise `click.UsageError` if a run with these options has no journal of messages."""
    if options.runtime == "arrays":
        raise click.UsageError(
            "--journal and --sniff show messages, but --runtime arrays sends no messages: use another runtime"
        )
    if options.standby:
        raise click.UsageError("--standby cannot be used with --journal or --sniff; remove one of them")
