"""`robochoc app`: starts the application in a browser on this machine."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import click

from robochoc.cli.options.value_types import WholeNumber
from robochoc.cli.reports.failures import USAGE, Failure
from robochoc.system.garbage import collection_paused


@click.command()
@click.option("--port", type=WholeNumber(0, 65535), default=0, metavar="N", help="Port of the page; 0 is a free port.")
@click.option("--no-open", is_flag=True, help="Print the address without opening a browser.")
@click.option(
    "--folder",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="DIR",
    help="Folder of saved teams.  [default: in the user's data folder]",
)
def app(port: int, folder: Path | None, *, no_open: bool) -> None:
    """Model a team, solve its problem, and watch it fly: a page in your browser, on this machine, until Ctrl-C.

    This requires the extra 'app': pip install 'robochoc[app]'

    \b
    robochoc app
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    try:
        with collection_paused():  # the imports create 100,000 objects
            from robochoc.app.server import serve_app
    except ModuleNotFoundError as missing:
        if not missing.name or missing.name.partition(".")[0] not in {"nicegui", "fastapi", "uvicorn"}:
            raise
        raise Failure(
            USAGE, f"the application requires {missing.name}, which is an extra; run: pip install 'robochoc[app]'"
        ) from None
    if folder is None:
        import platformdirs

        folder = Path(platformdirs.user_data_dir("robochoc")) / "teams"
    try:
        with suppress(KeyboardInterrupt):
            serve_app(folder, port=port, open_browser=not no_open, ready=_print_url)
    except OSError as refused:
        raise Failure(USAGE, f"the application cannot start: {refused}") from refused


def _print_url(url: str) -> None:
    click.echo(f"{url} is the application, on this machine; Ctrl-C ends it", err=True)
