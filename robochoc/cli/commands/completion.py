"""`robochoc completion`: prints the script with which a shell completes commands, options and names."""

from __future__ import annotations

import click

SHELLS = ("bash", "zsh", "fish")
VARIABLE = "_ROBOCHOC_COMPLETE"
"""The environment variable with which the script asks robochoc for completions (click's convention)."""


@click.command()
@click.argument("shell", type=click.Choice(SHELLS))
def completion(shell: str) -> None:
    """Print the completion script for SHELL: commands, options, protocols, orders, runtimes, folders.

    \b
    bash   eval "$(robochoc completion bash)"         in ~/.bashrc
    zsh    eval "$(robochoc completion zsh)"          in ~/.zshrc, after compinit
    fish   robochoc completion fish | source          in ~/.config/fish/config.fish
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from click.shell_completion import get_completion_class

    from robochoc.cli.group import cli

    kind = get_completion_class(shell)
    if kind is None:
        raise click.UsageError(f"no completion script exists for {shell}: use bash, zsh or fish")
    click.echo(kind(cli, {}, "robochoc", VARIABLE).source())
