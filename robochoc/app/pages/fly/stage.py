"""The stage: the flight and the conversation in frames, on one line of time. The browser draws it (`stage.js`)."""

from __future__ import annotations

from nicegui.element import Element

from robochoc.app.texts import say


class Stage(Element, component="stage.js"):
    """The two pages of a run.

    Args:
        flies: Whether there is a flight, or will be.
        talks: The same for the conversation.
    """

    def __init__(self, *, flies: bool, talks: bool) -> None:
        super().__init__()
        self._props["flies"] = flies
        self._props["talks"] = talks
        self._props["words"] = {
            "flight": say("fly.flight"),
            "conversation": say("fly.conversation"),
            "label": say("fly.line.label"),
            "play": say("fly.line.play"),
            "pause": say("fly.line.pause"),
            "speed": say("fly.line.speed"),
            "talks": say("fly.line.talks"),
            "flies": say("fly.line.flies"),
            "waiting": say("fly.line.waiting"),
            "step": _left_open("fly.line.step"),
            "seconds": _left_open("fly.line.seconds"),
            "epoch": _left_open("fly.line.epoch"),
        }

    def show(self, flight: str | None, talk: str | None, *, flies: bool, talks: bool) -> None:
        """Show pages by their addresses, which are relative to this one. None: it is not there (yet).

        `flies` and `talks` are as they were when it was made, or as what could not be made has changed them.
        """
        self._props["flight"] = flight
        self._props["talk"] = talk
        self._props["flies"] = flies
        self._props["talks"] = talks
        self.update()


def _left_open(key: str) -> str:
    """Return a text whose names in braces are filled in by the browser."""
    return say(key)
