"""The Directory Facilitator as the master serves it: robots are entered when they register, and anybody may ask."""

from __future__ import annotations

import time
from contextlib import suppress

from robochoc.communication.network.profile import Profile
from robochoc.communication.network.words import Told
from robochoc.services.descriptions import AgentDescription, Refused, ServiceDescription
from robochoc.services.directory import Directory
from robochoc.services.facilitator import handle

ASKED_AT_MOST = 20
"""Requests that a participant may make in a second."""


class TooOften(ValueError):  # noqa: N818 - named for what was done
    """Somebody asks too often."""


class DirectoryFacilitator:
    """The directory of the platform at `endpoint`, whose robots speak `protocol`."""

    def __init__(self, endpoint: str, protocol: str) -> None:
        self._endpoint = endpoint
        self._protocol = protocol
        self._directory = Directory()
        self._asked: dict[str, list[float]] = {}

    def enter(self, profile: Profile) -> None:
        """The robot of `profile` can be found: by its protocol, its variables, its topics. Raises `Refused`."""
        services = (
            *(ServiceDescription(name=topic, type="topic") for topic in profile.topics),
            *(ServiceDescription(name=variable, type="variable") for variable in profile.variables),
        )
        self.leave(profile.name)
        name = self._aid(profile.name)
        protocols = (self._protocol,) if self._protocol else ()
        addresses = (f"tls/{self._endpoint}",)
        description = AgentDescription(name, services, protocols, ("robochoc",), addresses=addresses)
        self._directory.register(description, time.time(), requester=name)

    def leave(self, name: str) -> None:
        """The robot called `name` cannot be found any more."""
        with suppress(Refused):
            self._directory.deregister(self._aid(name), requester=self._aid(name))

    def expire(self) -> None:
        """Forget those whose lease has ended."""
        self._directory.expire(time.time())

    def answer(self, requester: str, number: int, request: str) -> Told:
        """What `requester` asks for in SL0, answered. Raises `TooOften`."""
        now = time.time()
        recent = [t for t in self._asked.get(requester, []) if now - t < 1]
        self._asked[requester] = [*recent, now]
        if len(recent) >= ASKED_AT_MOST:
            raise TooOften(f"more than {ASKED_AT_MOST} requests a second")
        performative, content = handle(self._directory, self._aid(requester), request, now)
        return Told(number, str(performative), content)

    def _aid(self, name: str) -> str:
        """The name of a participant's agent identifier: `Robot3.1@host:port/robochoc`."""
        return f"{name}@{self._endpoint}/robochoc"
