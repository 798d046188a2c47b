"""What is wrong with a sketch, each told at the element that it is about, with what to do."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from robochoc.app.texts import say
from robochoc.system.errors import TransferableError


class About(StrEnum):
    """What kind of element a trouble is told at."""

    TEAM = "team"
    MAP = "map"
    ROBOT = "robot"
    DECISION = "decision"
    RULE = "rule"


class Severity(StrEnum):
    """How bad it is."""

    ERROR = "error"
    """The sketch is no team before that is mended."""
    HINT = "hint"
    """It is a team, but it is probably not what was meant, or cannot be decided."""


class Trouble(msgspec.Struct, frozen=True):
    """One thing that is wrong.

    Attributes:
        about: What kind of element it is told at.
        element: The element: the name of a robot or a decision, the id of a rule, or `map`, or `team`.
        key: The key of its text in the catalogue.
        named: What the text names.
        severity: How bad it is.
    """

    about: About
    element: str
    key: str
    named: dict[str, str | int] = {}
    severity: Severity = Severity.ERROR

    @property
    def remedy_key(self) -> str:
        """The key of the text that says what to do."""
        return f"{self.key}-remedy"

    @property
    def text(self) -> str:
        """What is wrong, in words."""
        return say(self.key, **self.named)

    @property
    def remedy(self) -> str:
        """What to do, in words."""
        return say(self.remedy_key, **self.named)

    @property
    def is_error(self) -> bool:
        """Whether the sketch is no team with it."""
        return self.severity == Severity.ERROR


class NotReadyError(TransferableError, ValueError):
    """A sketch is no team yet: something has to be mended first. The message says what, and how."""

    def __init__(self, trouble: Trouble) -> None:
        super().__init__(f"{trouble.text} {trouble.remedy}")


def shortened(name: object) -> str:
    """Return something that a user, or a file, has named, as it may stand in a sentence."""
    most = 60
    if isinstance(name, int) and abs(name) >= 10**most:
        return f"{str(name >> name.bit_length() - 60)[:6]}..."  # Python writes no integer of thousands of digits
    text = str(name)
    return text if len(text) <= most else f"{text[: most - 3]}..."
