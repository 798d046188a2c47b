"""`robochoc app`: the application, in a browser of this machine."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import click

from robochoc.cli.options.numbers import WholeNumber
from robochoc.cli.reports.failures import USAGE, Failure


@click.command()
@click.option("--port", type=WholeNumber(0, 65535), default=0, metavar="N", help="Port; 0: any free one.")
@click.option("--no-open", is_flag=True, help="Print the address, and open no browser.")
@click.option(
    "--folder",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="DIR",
    help="Where teams are kept.  [default: the user's data folder]",
)
def app(port: int, folder: Path | None, *, no_open: bool) -> None:
    """Model a team by hand, let it decide, and see it fly: a page in your browser, on this machine, until Ctrl-C.

    It needs the extra app: pip install 'robochoc[app]'

    \b
    robochoc app
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are
    try:
        from robochoc.app.server import serve_app
    except ModuleNotFoundError as missing:
        if not missing.name or missing.name.partition(".")[0] not in {"nicegui", "fastapi", "uvicorn"}:
            raise
        raise Failure(
            USAGE, f"the application needs {missing.name}, which is an extra; say: pip install 'robochoc[app]'"
        ) from None
    if folder is None:
        import platformdirs

        folder = Path(platformdirs.user_data_dir("robochoc")) / "teams"
    try:
        with suppress(KeyboardInterrupt):
            serve_app(folder, port=port, open_browser=not no_open, ready=_tell)
    except OSError as refused:
        raise Failure(USAGE, f"the application cannot start: {refused}") from refused


def _tell(url: str) -> None:
    click.echo(f"{url} is the application, on this machine; Ctrl-C ends it", err=True)
