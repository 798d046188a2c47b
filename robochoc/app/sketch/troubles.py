"""Errors in a sketch and hints, each with its element and a remedy."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from robochoc.app.texts import say
from robochoc.system.errors import RobochocError


class About(StrEnum):
    """The kind of element to which a trouble belongs."""

    TEAM = "team"
    MAP = "map"
    ROBOT = "robot"
    DECISION = "decision"
    RULE = "rule"


class Severity(StrEnum):
    """The severity of a trouble."""

    ERROR = "error"
    """The sketch cannot be converted to a team."""
    HINT = "hint"
    """The sketch can be converted, but probably differs from what is intended, or cannot be solved."""


class Trouble(msgspec.Struct, frozen=True):
    """An error or a hint.

    Attributes:
        about: The kind of element.
        element: The element: the name of a robot or a decision, the id of a rule, `map`, or `team`.
        key: The key of the text in the catalogue.
        named: The arguments of the text.
        severity: The severity.
    """

    about: About
    element: str
    key: str
    named: dict[str, str | int] = {}
    severity: Severity = Severity.ERROR

    @property
    def remedy_key(self) -> str:
        """The key of the remedy's text."""
        return f"{self.key}-remedy"

    @property
    def text(self) -> str:
        """The text of the error or hint."""
        return say(self.key, **self.named)

    @property
    def remedy(self) -> str:
        """The text of the remedy."""
        return say(self.remedy_key, **self.named)

    @property
    def is_error(self) -> bool:
        """True if the sketch cannot be converted to a team."""
        return self.severity == Severity.ERROR


class NotReadyError(RobochocError, ValueError):
    """The sketch cannot be converted to a team. The message contains the error and a remedy."""

    def __init__(self, trouble: Trouble) -> None:
        super().__init__(f"{trouble.text} {trouble.remedy}")


def shortened(name: object) -> str:
    """Return a name given by the user or a file, shortened for use in a sentence."""
    most = 60
    if isinstance(name, int) and abs(name) >= 10**most:
        return f"{str(name >> name.bit_length() - 60)[:6]}..."  # Python cannot print integers with thousands of digits
    text = str(name)
    return text if len(text) <= most else f"{text[: most - 3]}..."
