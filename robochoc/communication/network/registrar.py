"""The registration of robots at the master."""

from __future__ import annotations

from robochoc.communication.network.control_messages import (
    RegistrationDenied,
    Standing,
    Welcome,
)
from robochoc.communication.network.facilitator import DirectoryFacilitator
from robochoc.communication.network.master_connection import MasterConnection
from robochoc.communication.network.master_events import MasterEvents
from robochoc.communication.network.master_votes import MasterVotes
from robochoc.communication.network.members import NetworkMembers, RegistrationRefusedError
from robochoc.communication.network.profile import Profile
from robochoc.communication.network.settings import NetworkSettings


class Registrar:
    """Registers robots in `members`: checks profiles, welcomes robots, and adds them to the directory.

    Args:
        members: The registered robots.
        connection: The master's connection. Frames from and to a new incarnation are numbered from 1.
        facilitator: The directory of robots.
        events: Receives registrations and refusals.
        settings: The settings of the run. A welcome contains some of them.
        watched: True if robots are to report their events.
        votes: Knows the mission of robots that know several masters.
    """

    def __init__(
        self,
        members: NetworkMembers,
        connection: MasterConnection,
        facilitator: DirectoryFacilitator,
        events: MasterEvents,
        settings: NetworkSettings,
        watched: bool,  # noqa: FBT001 - passed on by the master
        votes: MasterVotes,
    ) -> None:
        self._members = members
        self._connection = connection
        self._facilitator = facilitator
        self._events = events
        self._settings = settings
        self._watched = watched
        self._votes = votes

    def register(self, name: str, profile: Profile, incarnation: str, standing: Standing | None) -> bool:
        """Register and welcome a robot, or refuse it. Return whether the robot is new."""
        known = self._members.robots.get(name)
        try:
            self._join_mission(standing)
            member = self._members.register(name, profile, incarnation, admitted=self._connection.policy.is_robot(name))
        except RegistrationRefusedError as refusal:
            self._deny(name, incarnation, str(refusal))
            return False
        if member is not known:
            self._connection.framing.forget(name)
            if unfit := self._facilitator.enter(profile):
                self._events.refuse(name, "be in the directory", unfit)
            self._events.registered(name)
        self._welcome(name, incarnation)
        return member is not known

    def _join_mission(self, standing: Standing | None) -> None:
        """Consider the standing of a robot. If another master closed its team, only the team's robots may register.

        Raises `RegistrationRefusedError`.
        """
        before = self._votes.mission
        if why := self._votes.admit(standing, closed=self._members.closed):
            raise RegistrationRefusedError(why)
        if self._votes.mission != before:
            for name, incarnation in self._members.expect(self._votes.team).items():
                self._deny(name, incarnation, "it is not a member of the team")

    def _deny(self, name: str, incarnation: str, why: str) -> None:
        self._events.refuse(name, "register", why)
        self._connection.send(name, RegistrationDenied(incarnation, why))

    def welcome_again(self) -> None:
        """Welcome again robots that have not answered a welcome since they registered or returned."""
        for name, incarnation in self._members.to_welcome().items():
            self._welcome(name, incarnation)

    def _welcome(self, name: str, incarnation: str) -> None:
        settings = self._settings
        welcome = Welcome(incarnation, self._connection.framing.run, settings.filters, self._watched, settings.private)
        self._connection.send(name, welcome)
