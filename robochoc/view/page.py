"""A scene as one self-contained HTML page: meshcat's viewer, the commands that fill it, a caption and a player.

Names of teams and robots may come from foreign files. They reach HTML as escaped text only. The page's
Content-Security-Policy lets no script run but the two it was made with, and nothing be loaded from anywhere.
"""

from __future__ import annotations

import base64
from html import escape
from importlib.resources import files
from string import Template

from robochoc.system.plain_text import printable
from robochoc.view.content_security import content_security_policy
from robochoc.view.drawing import commands
from robochoc.view.legend import legend
from robochoc.view.playback_json import playback_json
from robochoc.view.scene import Scene
from robochoc.view.script import viewer_script

_PLAYER = ("labels.js", "trails.js", "camera.js", "player.js", "timeline.js", "page.js")
"""The player's parts. In this order they are one script."""


def scene_page(scene: Scene) -> bytes:
    """Return the page, UTF-8.

    It plays by itself once, needs no server and no network, and is the same for equal scenes.
    """
    return _filled(scene, "\n".join(base64.b64encode(command).decode() for command in commands(scene)), "'none'")


def live_page(scene: Scene, port: int) -> bytes:
    """Return the same page without its commands: it asks the server that it came from, at this machine's `port`."""
    return _filled(scene, "", f"ws://127.0.0.1:{port} ws://localhost:{port}")


def _filled(scene: Scene, embedded: str, connections: str) -> bytes:
    here = files(__package__)
    viewer, player = viewer_script(), "".join((here / part).read_text(encoding="utf-8") for part in _PLAYER)
    return (
        Template((here / "page.html").read_text(encoding="utf-8"))
        .substitute(
            policy=content_security_policy((viewer, player), connections),
            title=_text(scene.title),
            facts="".join(f"<dt>{_text(name)}</dt><dd>{_text(fact)}</dd>" for name, fact in scene.facts),
            legend=legend(scene),
            commands=embedded,
            playback=playback_json(scene),
            viewer=viewer,
            player=player,
        )
        .encode()
    )


def _text(text: str) -> str:
    return escape(printable(text))
