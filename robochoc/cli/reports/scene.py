"""The 3D scene, as a file or live: what `solve` and `animate` share."""

from __future__ import annotations

from pathlib import Path

import click

from robochoc.formats import write_atomically
from robochoc.view.scene import Scene


def write_page(scene: Scene, path: Path, *, quiet: bool = False) -> None:
    """Write `scene` as one self-contained page, and say what to do with it."""
    from robochoc.view.page import page

    content = page(scene)
    write_atomically(path, content)
    if not quiet:
        click.echo(f"{path}: {len(content) / 1e6:.1f} MB; open it in a browser", err=True)


def serve_scene(scene: Scene, port: int = 0) -> None:
    """Show `scene` in a browser of this machine until Ctrl-C."""
    from robochoc.view.live import serve

    serve(
        scene,
        port=port,
        ready=lambda url: click.echo(f"{url} shows the scene on this machine; Ctrl-C ends it", err=True),
    )
