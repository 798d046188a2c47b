"""The master's registration of robots: checks profiles, welcomes robots, and adds them to the directory."""

from __future__ import annotations

from robochoc.communication.network.control_messages import RegistrationDenied, Welcome
from robochoc.communication.network.facilitator import DirectoryFacilitator
from robochoc.communication.network.master_connection import MasterConnection
from robochoc.communication.network.master_events import MasterEvents
from robochoc.communication.network.members import RegistrationRefusedError, TeamMembers
from robochoc.communication.network.profile import Profile
from robochoc.communication.network.settings import NetworkSettings


class Registrar:
    """Registers robots as `members`.

    Args:
        members: The registered robots.
        connection: The master's connection; frames of a new incarnation are numbered from 1.
        facilitator: The directory of robots.
        events: Receives registrations and refusals.
        settings: The settings of the run, part of which a welcome contains.
        watched: Whether robots are to report their events.
    """

    def __init__(
        self,
        members: TeamMembers,
        connection: MasterConnection,
        facilitator: DirectoryFacilitator,
        events: MasterEvents,
        settings: NetworkSettings,
        watched: bool,  # noqa: FBT001 - passed on by the master
    ) -> None:
        self._members = members
        self._connection = connection
        self._facilitator = facilitator
        self._events = events
        self._settings = settings
        self._watched = watched

    def register(self, name: str, profile: Profile, incarnation: str) -> bool:
        """Register a robot and welcome it, or refuse it; return whether it is new."""
        known = self._members.robots.get(name)
        try:
            member = self._members.register(name, profile, incarnation, admitted=self._connection.policy.is_robot(name))
        except RegistrationRefusedError as refusal:
            self._events.refuse(name, "register", str(refusal))
            self._connection.send(name, RegistrationDenied(incarnation, str(refusal)))
            return False
        if member is not known:
            self._connection.framing.forget(name)
            if unfit := self._facilitator.enter(profile):
                self._events.refuse(name, "be in the directory", unfit)
            self._events.registered(name)
        self._welcome(name, incarnation)
        return member is not known

    def welcome_again(self) -> None:
        """Welcome robots that have not answered a welcome since they registered or returned."""
        for name, incarnation in self._members.to_welcome().items():
            self._welcome(name, incarnation)

    def _welcome(self, name: str, incarnation: str) -> None:
        settings = self._settings
        welcome = Welcome(incarnation, self._connection.framing.run, settings.filters, self._watched, settings.private)
        self._connection.send(name, welcome)
