"""robochoc as a library: `robochoc.load(path).solve()`, and the paper's `AgentsContainer` (Figures 3 and 4).

    >>> import robochoc
    >>> outcome = robochoc.load("instances/queens3d-4").solve(runtime="simulator")
    >>> outcome.verdict
    <Verdict.NO_SOLUTION: 'no-solution'>

Both are thin, and on the same code as the command line.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robochoc.formats import check_team, read_robot, read_team
from robochoc.journal.events import Observer
from robochoc.model.orders import Order
from robochoc.model.outcome import Outcome
from robochoc.model.problem import Team
from robochoc.run.defaults import default_protocol
from robochoc.run.options import Options, Runtime, Withdrawal
from robochoc.run.orchestrator import solve
from robochoc.run.registry import UnknownProtocolError, installed_spelling, offers
from robochoc.run.scenario import Environment

if TYPE_CHECKING:
    from robochoc.communication.network.robot import Ending
    from robochoc.run.networked.address import Address

_MASTER, _AGENT = "Master", "Agent"


@dataclass(frozen=True)
class Problem:
    """A valid team: `team` is its data. Raises `InvalidInputError` for one that was built in Python and is not."""

    team: Team

    def __post_init__(self) -> None:
        check_team(self.team)

    def solve(
        self,
        protocol: str | None = None,
        runtime: str = Runtime.PROCESSES,
        *,
        order: str | None = None,
        withdraw: str | None = None,
        settings: Mapping[str, object] = {},
        observer: Observer | None = None,
        environment: Environment | None = None,
        **options: Any,  # noqa: ANN401 - the other fields of `Options`, by their names
    ) -> Outcome:
        """Let the robots solve it together; see `robochoc.run.options.Options` for what else can be said.

        Without a `protocol`, the one that suits the team. An `environment` gets each answer, and returns
        what changes next (`robochoc.run.scenario.Environment`).
        Raises what `robochoc.run.orchestrator.solve` raises, and `ValueError` or
        `TypeError` where an option is none. A program that starts processes is to do so below
        `if __name__ == "__main__":`.
        """
        asked = Options(
            protocol=installed_spelling(protocol) if protocol else default_protocol(self.team.kind),
            runtime=Runtime(runtime),
            order=Order(order) if order else None,
            withdraw=Withdrawal(withdraw) if withdraw else None,
            settings={name: str(value) for name, value in settings.items()},
            **options,
        )
        return solve(self.team, asked, observer=observer, environment=environment)


def load(path: Path | str) -> Problem:
    """Return the team in the folder `path`. Raises `InvalidInputError` with every mistake's file and line."""
    return Problem(read_team(Path(path)))


@dataclass
class AgentsContainer:
    """What runs on one machine of several: the master, or robots. The paper's, line by line in Python's spelling.

    Figure 3, the master's machine:

        main_container = AgentsContainer()
        main_container.set_agent_type("MasterABT")
        main_container.add_agent("MASTER", sniff=False)
        main_container.run()

    Figure 4, a robot's:

        container = AgentsContainer()
        container.set_agent_type("AgentABT")
        container.add_agent("Robot3.1", "Robot3.1.xml", sniff=True)
        container.set_main_container("192.168.1.14")
        container.run()

    The type's second part names the protocol, as its class is called (`MasterAFCng`) or as it is installed. `run`
    returns the outcome on the master's machine, and on a robot's how it ended there, by its name. Where the Authority
    is, where to listen, tokens and identities: as on the command line (`set_listen`, `set_authority`, `set_identity`).
    """

    _type: str = ""
    _agents: dict[str, tuple[Path | None, bool]] = field(default_factory=dict)
    _main: Address | None = None
    _listen: Address | None = None
    _authority: Path | None = None
    _identities: dict[str, tuple[Path | None, str | None]] = field(default_factory=dict)

    def set_agent_type(self, kind: str) -> None:
        """`MasterABT`, `AgentABT`: which end this is, and the protocol. Raises `ValueError`, `UnknownProtocolError`."""
        if not kind.startswith((_MASTER, _AGENT)):
            raise ValueError(f"{kind!r} is no type of agent: MasterABT or AgentABT, or with another protocol's name")
        protocol_called(kind.removeprefix(_MASTER).removeprefix(_AGENT))
        self._type = kind

    def add_agent(self, name: str, file: Path | str | None = None, *, sniff: bool = False) -> None:
        """Run the agent `name`: a robot with its `file`, or the master, which has none.

        `sniff`: whoever watches at the master is told of all that it says and hears.
        """
        self._agents[name] = (None if file is None else Path(file), sniff)

    def set_main_container(self, place: str) -> None:
        """Where the master listens: `HOST` or `HOST:PORT`. Raises `AddressError`."""
        from robochoc.run.networked.address import Address  # noqa: PLC0415 - an extra

        self._main = Address.parse(place)

    def set_listen(self, place: str) -> None:
        """The master: listen here, instead of on loopback. Raises `AddressError`."""
        from robochoc.run.networked.address import Address  # noqa: PLC0415 - an extra

        self._listen = Address.parse(place)

    def set_authority(self, folder: Path | str) -> None:
        """The master: the Authority's folder, instead of the user's own."""
        self._authority = Path(folder)

    def set_identity(self, name: str, folder: Path | str | None = None, token: str | None = None) -> None:
        """A robot: where its key and certificate are, and a token, if it has to get them first."""
        self._identities[name] = (None if folder is None else Path(folder), token)

    def run(self, observer: Observer | None = None, **plan: Any) -> Outcome | dict[str, Ending]:  # noqa: ANN401
        """Be the master, or the robots, of one run. `plan` holds further fields of `robochoc.run.networked.lead.Plan`.

        Raises what `lead` and `join` raise.
        """
        if not self._type:
            raise ValueError("say first what this container is: set_agent_type('MasterABT') or ('AgentABT')")
        if self._type.startswith(_MASTER):
            return self._lead(observer, plan)
        return self._join()

    def _lead(self, observer: Observer | None, plan: Mapping[str, Any]) -> Outcome:
        from robochoc.authority.authority import default_folder  # noqa: PLC0415 - an extra
        from robochoc.run.networked.lead import HERE, Plan, lead  # noqa: PLC0415 - the same

        protocol = protocol_called(self._type.removeprefix(_MASTER))
        folder = self._authority or default_folder()
        watched = any(sniff for _, sniff in self._agents.values())
        asked = Plan(folder, self._listen or HERE, protocol=protocol, **plan)
        return lead(asked, observer=observer, watched=watched).outcome

    def _join(self) -> dict[str, Ending]:
        from concurrent.futures import ThreadPoolExecutor  # noqa: PLC0415 - robots' machines only

        if self._main is None or not self._agents:
            raise ValueError("a robot needs its file and its master: add_agent(name, file), set_main_container(host)")
        with ThreadPoolExecutor(len(self._agents)) as pool:
            running = {name: pool.submit(self._robot, name, self._main) for name in self._agents}
            return {name: robot.result() for name, robot in running.items()}

    def _robot(self, name: str, main: Address) -> Ending:
        from robochoc.communication.network.robot_settings import RobotSettings  # noqa: PLC0415 - an extra
        from robochoc.run.networked.join import PATIENCE_S, identity_of, join  # noqa: PLC0415 - the same
        from robochoc.solver.compile import Compiler  # noqa: PLC0415 - the same

        file, sniff = self._agents[name]
        if file is None or file.stem != name:
            raise ValueError(f"{name} needs its file, {name}.xml")
        robot = read_robot(file)
        identity = identity_of(name, main, *self._identities.get(name, (None, None)))
        with Compiler() as compiler:
            return join(robot, main, identity, RobotSettings(PATIENCE_S, sniffed=sniff), compiler)


def protocol_called(word: str) -> str:
    """Return the installed name of the protocol that the paper's type names: `ABT` is `abt`.

    Raises `UnknownProtocolError`.
    """
    for offer in offers():
        if offer.protocol and word.casefold() in {offer.name.casefold(), offer.protocol.__name__.casefold()}:
            return offer.name
    raise UnknownProtocolError(f"no protocol {word!r} is installed; robochoc protocols lists them")
