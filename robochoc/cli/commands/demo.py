"""`robochoc demo`: a first team, from its files to the page with its flight, without any files from the user."""

from __future__ import annotations

import os
import shlex
import sys
from contextlib import chdir
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.paths import OutputFile

if TYPE_CHECKING:
    from collections.abc import Iterator

TEAM = "queens3d-4"
PAGE = Path("robochoc-demo.html")


@click.command()
@click.option(
    "--html",
    "page",
    type=OutputFile(),
    default=PAGE,
    show_default=True,
    metavar="FILE",
    help="The page to write: a 3D scene of the flight.",
)
@click.option(
    "--no-open",
    is_flag=True,
    help="Do not open the page in a browser. It is opened only from a terminal on a desktop.",
)
@click.pass_context
def demo(context: click.Context, page: Path, *, no_open: bool) -> None:
    """Solve a first problem, and show the flight as a page. This requires no files and takes a few seconds.

    16 drones on a 4 x 4 board choose levels such that no two attack each other, as queens do in chess. The command
    writes this team to a temporary folder, checks its files, and solves the problem: each drone is a process of its
    own. The drones prove that there is no solution for all of them; as few as possible withdraw, and the others fly.
    On a desktop, the page is opened in a browser.

    \b
    robochoc demo
    robochoc demo --html page.html --no-open
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.cli.group import cli
    from robochoc.system.temporary_files import PrivateFolder

    page = page.absolute()
    with PrivateFolder() as folder, chdir(folder):
        for text, words in _steps(page):
            click.echo(f"{text}\n$ robochoc {shlex.join(words)}")
            status = cli.main(words, prog_name="robochoc", standalone_mode=False)
            if status:
                context.exit(status)
            click.echo()
    click.echo("Next: the pages 'Your first team' and 'Lessons'; robochoc solve --help; in Python: help('robochoc')")
    if not no_open and on_a_desktop():
        import webbrowser

        webbrowser.open(page.as_uri())


def on_a_desktop() -> bool:
    """Return whether a person is watching, with a browser that has windows; others would take over the terminal."""
    windows = sys.platform in {"win32", "darwin"} or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
    return windows and sys.stdout.isatty()


def _steps(page: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield the description and the command of each step."""
    yield (
        "16 drones on a 4 x 4 board: each chooses a level such that no two attack each other. Each gets an XML file.",
        ["generate", "queens3d", "--n", "4", "-o", TEAM],
    )
    yield "The files are checked: their XML, their meaning, and the team as a whole.", ["validate", TEAM]
    processes = hasattr(os, "fork")
    where = "Each drone is a process." if processes else "All drones run in this process: others need POSIX."
    runtime = [] if processes else ["--runtime", "simulator"]
    yield (
        f"The drones solve the problem by messages. {where} As few as possible withdraw, and the others fly.",
        ["solve", TEAM, "--withdraw", "minimum", *runtime, "--html", str(page)],
    )
