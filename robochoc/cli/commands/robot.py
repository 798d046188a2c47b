"""`robochoc robot`: runs one robot on its own machine (Figure 4)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.local_problems import limits, local_options
from robochoc.cli.options.network import (
    identity_option,
    masters_option,
    network_errors_as_failures,
    patience_option,
    token_options,
)
from robochoc.cli.options.paths import InputPath
from robochoc.cli.options.ros import ros_options
from robochoc.cli.options.ros_setup import robot_publisher, ros_errors_as_failures
from robochoc.cli.options.sections import COMMON, SectionedCommand, Sections
from robochoc.cli.reports.failures import LIMIT, LOST, Failure
from robochoc.cli.reports.progress import print_above, progress_line

if TYPE_CHECKING:
    from robochoc.communication.network.robot import Ending
    from robochoc.model.problem import Assignment, Robot
    from robochoc.run.networked.address import Address


_SECTIONS: Sections = {
    COMMON: ("--master", "--token-file", "--token", "--identity", "--patience", "--sniff", "--json", "--help"),
    "Robots with several variables": ("--local-solutions", "--local-timeout", "--ace", "--no-cache"),
    "ROS (documentation, page ROS)": ("--ros", "--frame", "--scale", "--ros-type", "--tf", "--diagnostics"),
}


@click.command(cls=SectionedCommand, sections=_SECTIONS)
@click.argument("file", type=InputPath())
@masters_option(
    "--master",
    "places",
    "Address of the master; several by priority, separated by commas or repeated, if there are standby masters.",
    required=True,
)
@token_options()
@identity_option
@patience_option("Time without contact after which the master counts as lost.", 30.0, "patience")
@click.option("--sniff", is_flag=True, help="Report all messages of this robot to the master's journal.")
@local_options
@ros_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.pass_context
def robot(
    context: click.Context,
    /,
    file: Path,
    places: tuple[Address, ...],
    *,
    token: str | None,
    identity: Path | None,
    as_json: bool,
    **given: Any,  # noqa: ANN401 - options of the run and of compilation
) -> None:
    """Run the robot in FILE on this machine, in the next run of a master.

    The robot reads only its own file. Its first run requires a token (robochoc authority enrol), which it exchanges for
    a certificate. Later runs use the certificate, and renew it.

    \b
    robochoc robot Robot3.1.xml --master 192.168.1.14:7447 --token-file token
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    with network_errors_as_failures(file):
        with _stages(file.stem) as show_stage:
            ending, values, published = _run(file, places, (identity, token), given, show_stage)
        _print_ending(file.stem, ending, values, published, as_json=as_json)
    context.exit(LIMIT if ending.why.startswith("unknown") else 0)


@contextmanager
def _stages(name: str) -> Iterator[Callable[[str], None]]:
    """Yield a function that shows the stage of the run on a terminal."""
    import time

    from robochoc.communication.search_result import Progress

    with progress_line(name) as progress:
        began = time.monotonic()

        def show_stage(stage: str) -> None:
            if progress:
                progress(Progress(0, time.monotonic() - began, stage))

        yield show_stage


def _run(
    file: Path,
    places: tuple[Address, ...],
    credentials: tuple[Path | None, str | None],
    given: dict[str, Any],
    show_stage: Callable[[str], None],
) -> tuple[Ending, dict[str, float | str], list[str]]:
    """Run the robot in `file`, and publish its decision.

    Args:
        file: The robot's file.
        places: The addresses of the masters, by priority.
        credentials: The folder with the robot's certificate, and its token.
        given: The other options of the command.
        show_stage: Shows the stage of the run.

    Returns:
        How the run ended for the robot, its values (symbols by their names), and a line for each sink.

    Raises:
        Failure: if the run could not be completed.
    """
    from robochoc.communication.network.robot_settings import RobotSettings
    from robochoc.formats import read_robot
    from robochoc.run.networked.join import identity_of, join
    from robochoc.solver.cache import SolutionCache
    from robochoc.solver.compile import Compiler

    own = read_robot(file)  # before the token is used
    with robot_publisher(own, given) as publish:
        show_stage(f"looking for the master at {places[0]}")
        identity = identity_of(file.stem, places[0], *credentials, given["patience"])
        settings = RobotSettings(
            given["patience"],
            sniffed=given["sniff"],
            stage=show_stage,
            decided=_DecisionReporter(own, publish).report,
            lost_master=_LostMasterReporter(file.stem).report,
        )
        cache = None if given["no_cache"] else SolutionCache()
        bounds = limits(given["local_solutions"], given["local_timeout"], always_ace=given["always_ace"])
        with Compiler(bounds, cache) as compiler:
            ending = join(own, places, identity, settings, compiler)
        if ending.failed:
            raise Failure(LOST, f"{file.stem}: {ending.why}")
        return ending, _labelled(own, ending.assignment), publish(ending.why, ending.assignment)


class _LostMasterReporter:
    """Prints that the robot looks for another master. Repetitions are skipped."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._last = ("", "")

    def report(self, place: str, why: str) -> None:
        """Print the address of the last master, and why the robot has left it."""
        if (place, why) == self._last:
            return
        self._last = place, why
        from robochoc.system.plain_text import on_one_line

        print_above(on_one_line(f"{self._name}: left the master at {place}: {why}; looking for another master"))


def _labelled(own: Robot, assignment: Assignment) -> dict[str, float | str]:
    """Return the robot's values, in which symbols are replaced by their names."""
    domains = {variable.name: variable.domain for variable in own.variables}
    return {name: domains[name].label(value) for name, value in assignment.items()}


class _DecisionReporter:
    """Prints and publishes the robot's decisions while its team continues the search. Repetitions are skipped."""

    def __init__(self, own: Robot, publish: Callable[[str, Assignment], list[str]]) -> None:
        self._robot = own
        self._publish = publish
        self._last: Assignment | None = None

    def report(self, why: str, assignment: Assignment) -> None:
        """Print a decision on standard error, and publish it. An error while publishing does not end the search."""
        if assignment == self._last:
            return
        self._last = dict(assignment)
        print_above(_decision_line(self._robot.name, f"{why} so far", _labelled(self._robot, assignment)))
        try:
            with ros_errors_as_failures():
                self._publish(why, assignment)
        except Failure as failure:
            failure.show()


def _decision_line(name: str, why: str, values: Mapping[str, float | str]) -> str:
    from robochoc.system.plain_text import on_one_line

    decision = ", ".join(f"{variable} = {value}" for variable, value in values.items())
    return on_one_line(f"{name}: {why}; {decision or 'no value'}")


def _print_ending(
    name: str, ending: Ending, values: Mapping[str, float | str], published: Sequence[str], *, as_json: bool
) -> None:
    if as_json:
        import msgspec

        result = {"robot": name, "outcome": ending.why, "assignment": values}
        click.echo(msgspec.json.encode(result).decode())
        return
    click.echo(_decision_line(name, ending.why, values))
    for line in published:
        click.echo(line, err=True)
