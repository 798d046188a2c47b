"""The master's Directory Facilitator. Robots are added when they register, and all participants may query it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress

from robochoc.communication.network.control_messages import (
    DirectoryAnswer,
    DirectoryRequest,
    JournalAnswer,
    JournalRequest,
)
from robochoc.communication.network.journal_server import JournalServer
from robochoc.communication.network.profile import Profile
from robochoc.protocols.acts import Performative
from robochoc.services.descriptions import MAX_SERVICES, AgentDescription, RequestRefusedError, ServiceDescription
from robochoc.services.directory import Directory
from robochoc.services.facilitator import handle, notification, subscribe
from robochoc.services.sl import df_on
from robochoc.system.errors import RobochocError

MAX_REQUESTS_PER_S = 20
"""The maximum number of requests by a participant in one second."""


class TooManyRequestsError(RobochocError, ValueError):
    """Raised if a participant sends too many requests."""


class DirectoryFacilitator:
    """The directory of the platform at `endpoint`, whose robots use `protocol`."""

    def __init__(self, endpoint: str, protocol: str) -> None:
        self._endpoint = endpoint
        self._protocol = protocol
        self._directory = Directory()
        self._df = df_on(f"{endpoint}/robochoc")
        self._asked: dict[str, list[float]] = {}
        self._numbers: dict[str, int] = {}
        """The number of the last request by each subscriber."""

    def enter(self, profile: Profile) -> str:
        """Add the robot of `profile` to the directory, with its protocol and as many topics and variables as fit.

        Return the reason why the robot cannot be added, or an empty text. The robot participates in any case.
        """
        services = (
            *(ServiceDescription(name=topic, type="topic") for topic in profile.topics),
            *(ServiceDescription(name=variable, type="variable") for variable in profile.variables),
        )[:MAX_SERVICES]
        self.leave(profile.name)
        name = self._aid(profile.name)
        protocols = (self._protocol,) if self._protocol else ()
        addresses = (f"tls/{self._endpoint}",)
        description = AgentDescription(name, services, protocols, ("robochoc",), addresses=addresses)
        try:
            self._directory.register(description, time.time(), requester=name)
        except RequestRefusedError as refused:
            return str(refused)
        return ""

    def leave(self, name: str) -> None:
        """Remove the robot called `name` from the directory."""
        with suppress(RequestRefusedError):
            self._directory.deregister(self._aid(name), requester=self._aid(name))

    def expire(self) -> None:
        """Remove agents whose lease has ended."""
        self._directory.expire(time.time())

    def count(self, requester: str) -> None:
        """Count a request by `requester` to the directory or the master. Raises `TooManyRequestsError`."""
        now = time.time()
        recent = [t for t in self._asked.get(requester, []) if now - t < 1]
        if len(recent) >= MAX_REQUESTS_PER_S:
            raise TooManyRequestsError(f"more than {MAX_REQUESTS_PER_S} requests a second")
        self._asked[requester] = [*recent, now]

    def answer(self, requester: str, ask: DirectoryRequest) -> DirectoryAnswer:
        """Return the answer in SL0 to a request by `requester`. The results of subscriptions come from `notices`."""
        now = time.time()
        aid = self._aid(requester)
        if not ask.subscribe:
            return _answer_to(ask.number, handle(self._directory, aid, ask.content, now))
        self._numbers[aid] = ask.number
        return _answer_to(ask.number, subscribe(self._directory, aid, ask.content, now))

    def notices(self) -> Iterator[tuple[str, DirectoryAnswer]]:
        """Yield the answers to subscribers, each with the subscriber's name."""
        for notice in self._directory.notices():
            number = self._numbers.get(notice.subscriber, 0)
            yield (
                notice.subscriber.partition("@")[0],
                _answer_to(number, (Performative.INFORM, notification(self._df, notice))),
            )

    def _aid(self, name: str) -> str:
        """Return the name in a participant's agent identifier: `Robot3.1@host:port/robochoc`."""
        return f"{name}@{self._endpoint}/robochoc"


class RequestHandler:
    """Answers requests, at a limited rate for each member. `send` sends answers, `refuse` reports refusals."""

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
        """Answer `sender`, unless it sends requests too often."""
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


def _answer_to(number: int, answer: tuple[Performative, str]) -> DirectoryAnswer:
    performative, content = answer
    return DirectoryAnswer(number, str(performative), content)
