"""`robochoc robot`: one robot, on its own machine (Figure 4)."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.local_problems import limits, local_options
from robochoc.cli.options.network import PlaceType, network_failures_told
from robochoc.cli.options.paths import InputPath
from robochoc.cli.options.ros import outlets, ros_options
from robochoc.cli.options.tokens import token_options
from robochoc.cli.reports.failures import LIMIT, LOST, Failure
from robochoc.cli.reports.progress import progress_line

if TYPE_CHECKING:
    from robochoc.run.networked.address import Address


@click.command()
@click.argument("file", type=InputPath())
@click.option(
    "--master", "place", type=PlaceType(), required=True, metavar="HOST:PORT", help="Where the master listens."
)
@token_options()
@click.option(
    "--identity",
    type=InputPath(),
    metavar="DIR",
    help="Where the robot's key and certificate are  [default: robochoc/identities/NAME in your data folder]",
)
@click.option(
    "--patience",
    type=click.FloatRange(0, min_open=True),
    default=30.0,
    show_default=True,
    metavar="SECONDS",
    help="How long the master may be out of reach, at the beginning and later.",
)
@click.option(
    "--sniff",
    is_flag=True,
    help="Let the master's journal, and so who may sniff, have all that this robot says and hears.",
)
@local_options
@ros_options
@click.option("--json", "as_json", is_flag=True, help="One JSON object on standard output.")
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
    """Be the robot of FILE in the next run of the master, until that is over.

    The robot knows its own file and nothing else. The first time it needs a token, with which it gets its certificate;
    afterwards it proves with that who it is, and renews it by itself.
    """
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
            published = stack.enter_context(outlets(itself, given))
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
