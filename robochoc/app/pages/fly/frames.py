"""The frames with the flight and the conversation on a common time line, drawn in the browser (`frames.js`)."""

from __future__ import annotations

from nicegui.element import Element

from robochoc.app.texts import say


class RunFrames(Element, component="frames.js"):
    """The frames of a run.

    Args:
        flies: True if there is or will be a flight.
        talks: True if there is or will be a conversation.
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
            "step": _template("fly.line.step"),
            "seconds": _template("fly.line.seconds"),
            "epoch": _template("fly.line.epoch"),
        }

    def show(self, flight: str | None, talk: str | None, *, flies: bool, talks: bool) -> None:
        """Show pages, given by their relative addresses. None: the page does not exist (yet).

        `flies` and `talks` differ from their initial values if a page could not be built.
        """
        self._props["flight"] = flight
        self._props["talk"] = talk
        self._props["flies"] = flies
        self._props["talks"] = talks
        self.update()


def _template(key: str) -> str:
    """Return a text in which the browser replaces the names in braces."""
    return say(key)
