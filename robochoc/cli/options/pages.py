"""`--html` and `--serve`: the 3D scene as a page, the same way in every command that has one."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import click

from robochoc.cli.options.paths import OutputFile

Command = TypeVar("Command", bound=Callable[..., object])


def html_option(*short: str) -> Callable[[Command], Command]:
    """Return the option `--html FILE`, with other spellings for it."""
    return click.option(
        "--html",
        *short,
        "html",
        type=OutputFile(),
        metavar="FILE",
        help="Write the 3D scene: one HTML file, for a browser.",
    )


serve_option = click.option("--serve", is_flag=True, help="Show the 3D scene on this machine until Ctrl-C.")
