"""What anybody may ask of the master besides taking part: the Directory Facilitator's answers, and the journal."""

from __future__ import annotations

from collections.abc import Callable

from robochoc.communication.network.control_messages import (
    DirectoryAnswer,
    DirectoryRequest,
    JournalAnswer,
    JournalRequest,
)
from robochoc.communication.network.facilitator import DirectoryFacilitator, TooManyRequestsError
from robochoc.communication.network.journal_server import JournalServer


class Requests:
    """Answers requests, so many a second of each: `tell` takes answers, and `refuse` who was refused what, and why."""

    def __init__(
        self,
        desk: JournalServer,
        facilitator: DirectoryFacilitator,
        tell: Callable[[str, DirectoryAnswer | JournalAnswer], None],
        refuse: Callable[[str, str, str], None],
    ) -> None:
        self._desk = desk
        self._facilitator = facilitator
        self._tell = tell
        self._refuse = refuse

    def answer(self, sender: str, word: DirectoryRequest | JournalRequest) -> None:
        """Answer `sender`, unless it asks too often."""
        try:
            self._facilitator.count(sender)
        except TooManyRequestsError as often:
            self._refuse(sender, "ask the Directory Facilitator", str(often))
            return
        told = (
            self._desk.welcome(sender, word)
            if isinstance(word, JournalRequest)
            else self._facilitator.answer(sender, word)
        )
        self._tell(sender, told)
