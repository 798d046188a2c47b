"""`robochoc robot`: one robot on its own machine (Figure 4)."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.local_problems import limits, local_options
from robochoc.cli.options.network import identity_option, master_option, network_failures_told, patience_option
from robochoc.cli.options.paths import InputPath
from robochoc.cli.options.ros import ros_options
from robochoc.cli.options.ros_setup import robot_publisher
from robochoc.cli.options.sections import COMMON, SectionedCommand, Sections
from robochoc.cli.options.tokens import token_options
from robochoc.cli.reports.failures import LIMIT, LOST, Failure
from robochoc.cli.reports.progress import progress_line

if TYPE_CHECKING:
    from robochoc.run.networked.address import Address


_SECTIONS: Sections = {
    COMMON: ("--master", "--token-file", "--token", "--identity", "--patience", "--sniff", "--json", "--help"),
    "Robots with several variables": ("--local-solutions", "--local-timeout", "--ace", "--no-cache"),
    "ROS (docs/guides/ros.md)": ("--ros", "--frame", "--scale"),
}


@click.command(cls=SectionedCommand, sections=_SECTIONS)
@click.argument("file", type=InputPath())
@master_option
@token_options()
@identity_option
@patience_option("Time without contact after which the master is given up.", 30.0, "patience")
@click.option("--sniff", is_flag=True, help="Report all messages of this robot to the master's journal.")
@local_options
@ros_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.pass_context
def robot(
    context: click.Context,
    /,
    file: Path,
    place: Address,
    *,
    token: str | None,
    identity: Path | None,
    as_json: bool,
    **given: Any,  # noqa: ANN401 - how it takes part and compiles
) -> None:
    """Run the robot of FILE on this machine, in the next run of a master.

    The robot reads its own file and nothing else. The first time it needs a token (robochoc authority enrol), for which
    it gets a certificate. Later runs use the certificate, and renew it.

    \b
    robochoc robot Robot3.1.xml --master 192.168.1.14:7447 --token-file token
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are
    with network_failures_told(file):
        from robochoc.communication.network.robot_settings import RobotSettings
        from robochoc.communication.run_result import Progress
        from robochoc.formats import read_robot
        from robochoc.run.networked.join import identity_of, join
        from robochoc.solver.cache import SolutionCache
        from robochoc.solver.compile import Compiler
        from robochoc.system.plain_text import on_one_line

        with progress_line(file.stem) as progress, ExitStack() as stack:
            began = _seconds()

            def stage(words: str) -> None:
                if progress:
                    progress(Progress(0, _seconds() - began, words))

            itself = read_robot(file)  # before its token is spent
            published = stack.enter_context(robot_publisher(itself, given))
            stage(f"looking for the master at {place}")
            proof = identity_of(file.stem, place, identity, token, given["patience"])
            settings = RobotSettings(given["patience"], sniffed=given["sniff"], stage=stage)
            cache = None if given["no_cache"] else SolutionCache()
            bounds = limits(given["local_solutions"], given["local_timeout"], always_ace=given["always_ace"])
            with Compiler(bounds, cache) as compiler:
                ending = join(itself, place, proof, settings, compiler)
            if ending.failed:
                raise Failure(LOST, f"{file.stem}: {ending.why}")
            told = published(ending.why, ending.assignment)
        if as_json:
            import msgspec

            result = {"robot": file.stem, "outcome": ending.why, "assignment": ending.assignment}
            click.echo(msgspec.json.encode(result).decode())
        else:
            decision = ", ".join(f"{name} = {value}" for name, value in ending.assignment.items())
            click.echo(on_one_line(f"{file.stem}: {ending.why}; {decision or 'no value'}"))
            for line in told:
                click.echo(line, err=True)
    context.exit(LIMIT if ending.why.startswith("unknown") else 0)


def _seconds() -> float:
    import time

    return time.monotonic()
