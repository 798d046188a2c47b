"""Requests to the master of those that need not take part: to the Directory Facilitator, and for the journal."""

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
    """Answers requests, up to a rate for each member: `send` sends answers, and `refuse` reports refusals."""

    def __init__(
        self,
        journal_server: JournalServer,
        facilitator: DirectoryFacilitator,
        send: Callable[[str, DirectoryAnswer | JournalAnswer], None],
        refuse: Callable[[str, str, str], None],
    ) -> None:
        self._journal_server = journal_server
        self._facilitator = facilitator
        self._send = send
        self._refuse = refuse

    def answer(self, sender: str, request: DirectoryRequest | JournalRequest) -> None:
        """Answer `sender`, unless it asks too often."""
        try:
            self._facilitator.count(sender)
        except TooManyRequestsError as often:
            self._refuse(sender, "ask the Directory Facilitator", str(often))
            return
        answer = (
            self._journal_server.welcome(sender, request)
            if isinstance(request, JournalRequest)
            else self._facilitator.answer(sender, request)
        )
        self._send(sender, answer)
