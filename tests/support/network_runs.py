"""A run across machines whose robots are threads of the test: with a real router, real zenoh, and mutual TLS."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

import zenoh

from robochoc.authority.admission import InMemoryAuthority
from robochoc.communication.network.control_messages import ControlMessage
from robochoc.communication.network.framing import Framing
from robochoc.communication.network.journal_server import Publication
from robochoc.communication.network.local import LOOPBACK
from robochoc.communication.network.master import Master
from robochoc.communication.network.members import NetworkMembers
from robochoc.communication.network.robot import Ending, NetworkRobot
from robochoc.communication.network.robot_settings import RobotSettings
from robochoc.communication.network.settings import NetworkSettings
from robochoc.communication.network.transport import Transport
from robochoc.communication.search_result import SearchResult
from robochoc.journal.events import AnyEvent, Lost, Received, Refused
from robochoc.model.problem import Team
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compiled_team import CompiledRobot
from tests.support.limits import HANG_S, wait_until
from tests.support.paused_abt import CHAIN, PausedABT
from tests.support.ports import free_endpoint

SLICE_S = 0.2
PATIENT = NetworkSettings(patience_s=HANG_S)
"""Nobody is lost who is only slow."""


def put(transport: Transport, key: str, content: bytes = b"anything") -> None:
    """Put on a key that the transport itself would not put on."""
    transport._session.put(key, content, congestion_control=zenoh.CongestionControl.BLOCK)  # noqa: SLF001


def frame(
    run: NetworkRun, sender: str, receiver: str, word: ControlMessage, number: int = 1, of_run: str = ""
) -> bytes:
    """A frame of this run as `sender` would write it."""
    framing = Framing(sender, of_run or run.master.run)
    framing._written[receiver] = number - 1  # noqa: SLF001
    return framing.write(receiver, word)


class NetworkRun:
    """`team` searches by `PausedABT`, and is held until `let_go`. `absent` robots do not come by themselves.

    `master` and the household are there for tests to use; `events` is all that was observed.
    """

    def __init__(
        self,
        folder: Path,
        team: Team = CHAIN,
        settings: NetworkSettings = PATIENT,
        *,
        absent: Iterable[str] = (),
        seconds: float | None = None,
        publication: Publication | None = None,
    ) -> None:
        self.team = team
        self.household = InMemoryAuthority(team.order)
        self.events: list[AnyEvent] = []
        self.result: SearchResult | None = None
        self.error: Exception | None = None
        self.held: tuple[bool, float] | None = None
        self.endings: dict[str, Ending] = {}
        self.robots: dict[str, NetworkRobot] = {}
        self.threads: dict[str, threading.Thread] = {}
        self.settings = settings
        self._seconds = seconds
        self._publication = publication
        self._absent = set(absent)
        self._gate = folder / "go"
        self._given_up = False
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        endpoint = free_endpoint()
        identity = self.household.master_identity((LOOPBACK,))
        members = NetworkMembers(self.team.order)
        master = Master(
            self.household, identity, endpoint, members, self.settings, observer=self.events.append, watched=True
        )
        if self._publication:
            master.publish(self._publication)
        self.master = self._stack.enter_context(master)
        self.endpoint = endpoint
        self._search = threading.Thread(target=self._run)
        self._search.start()
        for name in self.team.order:
            if name not in self._absent:
                self.start(name)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._gate.touch()
        self._search.join()
        for thread in self.threads.values():
            thread.join()
        self._stack.close()

    # What a test does

    def start(self, name: str, endpoint: str = "") -> None:
        """The robot `name` comes."""
        self.threads[name] = threading.Thread(target=self._take_part, args=[name, endpoint or self.endpoint])
        self.threads[name].start()

    def transport(self, name: str, *, endpoint: str = "", patience_s: float = HANG_S) -> Transport:
        """A connection of somebody who has an identity of `name` from the household."""
        place, identity = endpoint or self.endpoint, self.household.identity(name)
        return Transport(place, identity, watch=(), patience_s=patience_s, lease_ms=self.settings.lease_ms)

    def let_go(self) -> SearchResult:
        """Let the team search to the end, and return what came of it."""
        self._gate.touch()
        return self.wait_for_result()

    def give_up(self) -> None:
        """End the run before all robots are there."""
        self._given_up = True

    def wait_until_impatient(self, name: str) -> None:
        """Wait until the master does not answer the robot any more, and move its clock until its patience is over."""
        registration = self.robots[name]._registration  # noqa: SLF001
        self.wait_until(lambda: registration._unanswered_since is not None, f"{name} is answered")  # noqa: SLF001
        registration._unanswered_since = time.monotonic() - 2 * self.settings.patience_s  # noqa: SLF001

    def wait_for_result(self) -> SearchResult:
        """What came of the search, as soon as it is over."""
        self._search.join(HANG_S)
        assert not self._search.is_alive(), "the search does not end"
        if self.error:
            raise self.error
        assert self.result
        return self.result

    def wait_for_refusal(self, who: str, what: str, why: str) -> Refused:
        """The first refusal that these regular expressions are found in, as soon as there is one."""
        found: list[Refused] = []

        def look() -> bool:
            found.extend(
                one
                for one in self.refusals
                if re.fullmatch(who, one.who) and re.search(what, one.what) and re.search(why, one.why)
            )
            return bool(found)

        try:
            wait_until(look, "", HANG_S)
        except AssertionError:
            raise AssertionError(f"no refusal of {who}, {what}, {why} among {self.refusals}") from None
        return found[0]

    def wait_until(self, condition: Callable[[], bool], otherwise: str) -> None:
        """Wait until `condition` holds."""
        wait_until(condition, otherwise, HANG_S)

    def wait_for_progress(self) -> None:
        """Wait until three more messages of the search have come."""
        before = self.received
        wait_until(lambda: self.received >= before + 3, f"the search does not go on: {self.error}", HANG_S)

    @property
    def received(self) -> int:
        """Messages of the search that were received so far."""
        return sum(isinstance(event, Received) for event in list(self.events))

    @property
    def refusals(self) -> list[Refused]:
        return [event for event in list(self.events) if isinstance(event, Refused)]

    @property
    def losses(self) -> list[Lost]:
        return [event for event in list(self.events) if isinstance(event, Lost)]

    @property
    def router(self) -> int:
        """The id of the router's process."""
        process = self.master._policy._router._process  # noqa: SLF001
        return process.pid if process else 0

    # Its threads

    def _run(self) -> None:
        try:
            deadline = time.monotonic() + HANG_S
            while not self._given_up and time.monotonic() < deadline and not self.master.members.closed:
                self.master.gather(time.monotonic() + SLICE_S)
            if self.master.members.closed:
                parameters = RunParameters(settings={"file": str(self._gate)})
                self.result = self.master.search("held", PausedABT.traits, parameters, self._seconds)
                if not self.result.lost and self.result.assignments:
                    self.held = self.master.checked(self.result.assignments)
        except Exception as error:  # noqa: BLE001 - the test is told
            self.error = error
        self.master.leave("the run is over", failed=self.error is not None)

    def _take_part(self, name: str, endpoint: str) -> None:
        with self.transport(name, endpoint=endpoint) as transport:
            robot = NetworkRobot(
                CompiledRobot(self.team[name]),
                self.household.identity(name),
                transport,
                lambda _name: PausedABT,
                RobotSettings(self.settings.patience_s),
            )
            self.robots[name] = robot
            self.endings[name] = robot.run()
