"""robochoc as a library: `robochoc.load(path).solve()`, and the paper's `AgentsContainer` (Figures 3 and 4).

    >>> import robochoc
    >>> outcome = robochoc.load("instances/queens3d-4").solve(runtime="simulator")
    >>> outcome.verdict
    <Verdict.NO_SOLUTION: 'no-solution'>

Both are thin layers over the code that the command line uses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robochoc.formats import check_team, read_robot
from robochoc.formats.problems import read_problem
from robochoc.journal.events import Observer
from robochoc.model.original_names import renamed_outcome, renamed_team, robots_called
from robochoc.model.outcome import Outcome
from robochoc.model.problem import Team
from robochoc.modelling.option_names import errors_in_python, in_python
from robochoc.modelling.solution import Solution
from robochoc.modelling.solving import Solvable
from robochoc.modelling.start_values import start_values
from robochoc.run.registry import UnknownProtocolError, installed_protocols
from robochoc.solver.agent_problem import StartValues
from robochoc.solver.errors import UnsupportedError
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.plain_text import counted
from robochoc.system.posix import IS_POSIX, REQUIREMENT

if TYPE_CHECKING:
    from robochoc.communication.network.robot import Ending
    from robochoc.run.networked.address import Address

_MASTER, _AGENT = "Master", "Agent"


@dataclass(frozen=True, repr=False)
class Problem(Solvable):
    """A constraint problem that a team of robots can solve.

    Attributes:
        team: The robots, their variables and constraints, read from files, generated, or built in Python.
        names: For a problem in a file of another tool: the original names of robots and variables, by their names in
            the team. Solutions use the original names.
        notes: The changes made while reading the file, as `robochoc import` reports them: pairs of keyword and
            sentence.
        ordered: True if the priority order of the robots was given. Files of other tools give no order.

    Raises:
        InvalidInputError: if the team is invalid. The error lists every mistake.
    """

    team: Team
    names: Mapping[str, str] = field(default_factory=dict)
    notes: Sequence[tuple[str, str]] = ()
    ordered: bool = True

    def __post_init__(self) -> None:
        check_team(self.team)

    def _team_to_solve(self) -> Team:
        return self.team

    def _start_values(self, start: object, team: Team) -> StartValues:
        called = {original: name for name, original in self.names.items()}
        return start_values(start, team, self.names, {}, lambda name: called.get(name, name))

    @property
    def _is_ordered(self) -> bool:
        return self.ordered

    def _robots_called(self, team: Team) -> Mapping[str, str]:
        return robots_called(team, self.names)

    def _solution(self, outcome: Outcome, team: Team) -> Solution:
        return Solution.of(renamed_outcome(outcome, self.names), renamed_team(team, self.names, outcome.events))

    def __repr__(self) -> str:
        constraints = counted(sum(1 for _ in self.team.constraints()), "constraint")
        return f"<problem {self.team.name}: {counted(len(self.team.robots), 'robot')}, {constraints}>"


def load(
    path: Path | str,
    *more: Path | str,
    format: str | None = None,  # noqa: A002 - as the option
    infinity: int | None = None,
    owner: str | None = None,
    allow_code: bool = False,
) -> Problem:
    """Return the problem in a team's folder, or in a file of another tool.

    Args:
        path: A folder with an XML file for each robot, and `scenario.xml` if the problem changes over time; or a file
            of FRODO, DisChoco, pyDCOP, XCSP3 or toulbar2.
        *more: Further files of the same problem, such as pyDCOP's distribution and scenario.
        format: For files of other tools: the name of the format, as `robochoc import --help` lists it. None: the format
            is recognised from the files.
        infinity: For files of other tools: a combination of values with this cost or more is forbidden. None: no cost
            means that a combination is forbidden.
        owner: For files of other tools: a regular expression. Variables whose names have the same match (or the same
            first group) belong to one robot. None: each variable has its own robot.
        allow_code: True if Python files to which pyDCOP's files refer may be executed.

    Raises:
        InvalidInputError: if the files are invalid. The error lists every mistake with its file and line.

    Example:
        >>> import robochoc
        >>> robochoc.load("instances/queens3d-4").team.name
        'queens3d-4'
    """
    options: dict[str, Any] = {"infinity": infinity, "owner": owner, "allow_code": allow_code}
    with errors_in_python((*options, "format")):
        read = read_problem(Path(path), *map(Path, more), dialect=format, **options)
    notes = [(keyword, in_python(sentence, (*options, "format"))) for keyword, sentence in read.notes]
    return Problem(read.team, read.names if read.foreign else {}, notes, ordered=not read.foreign)


@dataclass
class AgentsContainer:
    """The agents on one machine of a network: the master, or robots (Figures 3 and 4 of the paper, in Python).

    The master's machine (Figure 3):

        main_container = AgentsContainer()
        main_container.set_agent_type("MasterABT")
        main_container.add_agent("MASTER", sniff=False)
        main_container.run()

    A robot's machine (Figure 4):

        container = AgentsContainer()
        container.set_agent_type("AgentABT")
        container.add_agent("Robot3.1", "Robot3.1.xml", sniff=True)
        container.set_main_container("192.168.1.14")
        container.run()

    The second part of the type is the protocol: the name of its class (`MasterAFCng`), or its installed name.
    """

    _type: str = ""
    _agents: dict[str, tuple[Path | None, bool]] = field(default_factory=dict)
    _main: tuple[Address, ...] = ()
    _listen: Address | None = None
    _authority: Path | None = None
    _identities: dict[str, tuple[Path | None, str | None]] = field(default_factory=dict)

    def set_agent_type(self, kind: str) -> None:
        """Set whether this container runs the master or robots, and their protocol.

        Args:
            kind: `Master` or `Agent`, followed by the protocol: `MasterABT`, `AgentABT`.

        Raises:
            ValueError: if `kind` does not begin with `Master` or `Agent`.
            UnknownProtocolError: if no such protocol is installed.
        """
        if not kind.startswith((_MASTER, _AGENT)):
            raise ValueError(
                f"{kind!r} is not a type of agent: write MasterABT or AgentABT, with any protocol's name for ABT"
            )
        protocol_called(kind.removeprefix(_MASTER).removeprefix(_AGENT))
        self._type = kind

    def add_agent(self, name: str, file: Path | str | None = None, *, sniff: bool = False) -> None:
        """Add an agent to this container.

        Args:
            name: The name of the robot or the master.
            file: The robot's XML file. The master has no file.
            sniff: True if the sniffer at the master shows the messages that the agent sends and receives.
        """
        self._agents[name] = (None if file is None else Path(file), sniff)

    def set_main_container(self, place: str) -> None:
        """Set the address of the master, on a robot's machine.

        Args:
            place: `HOST` or `HOST:PORT`; several addresses by priority, separated by commas, if there are standby
                masters.

        Raises:
            AddressError: if `place` is not an address, or an address is repeated.
        """
        from robochoc.run.networked.address import Address, check_different  # noqa: PLC0415 - an extra

        places = Address.parse_all(place)
        check_different(places)
        self._main = places

    def set_listen(self, place: str) -> None:
        """Set the address at which the master listens. By default, only this machine can connect (loopback).

        Args:
            place: `HOST` or `HOST:PORT`.

        Raises:
            AddressError: if `place` is not an address.
        """
        from robochoc.run.networked.address import Address  # noqa: PLC0415 - an extra

        self._listen = Address.parse(place)

    def set_authority(self, folder: Path | str) -> None:
        """Set the Authority's folder, on the master's machine. By default, it is in the user's data folder."""
        self._authority = Path(folder)

    def set_identity(self, name: str, folder: Path | str | None = None, token: str | None = None) -> None:
        """Set the folder or the token with which the robot `name` proves its identity.

        Args:
            name: The robot's name.
            folder: The folder with the robot's key and certificate. By default, it is in the user's data folder.
            token: The token with which the robot enrols if it has no certificate yet.
        """
        self._identities[name] = (None if folder is None else Path(folder), token)

    def run(self, observer: Observer | None = None, **plan: Any) -> Outcome | dict[str, Ending]:  # noqa: ANN401
        """Run the agents of this container until the run ends.

        Args:
            observer: Called with every event that the master receives.
            **plan: Other fields of `robochoc.run.networked.master_run.Plan`, for the master.

        Returns:
            On the master's machine, the outcome; on a robots' machine, the end of the run for each robot, by name.

        Raises:
            ValueError: if the container has no type, a robot has no file, or the address of the master is missing.
            UnsupportedError: on Windows.
        """
        if not IS_POSIX:
            raise UnsupportedError(
                f"a run on several machines {REQUIREMENT}: solve the problem with runtime='simulator'"
            )
        if not self._type:
            raise ValueError(
                "the container has no type: call set_agent_type('MasterABT') or set_agent_type('AgentABT') first"
            )
        if self._type.startswith(_MASTER):
            return self._lead(observer, plan)
        return self._join()

    def _lead(self, observer: Observer | None, plan: Mapping[str, Any]) -> Outcome:
        from robochoc.authority.authority import default_authority_folder  # noqa: PLC0415 - an extra
        from robochoc.run.networked.master_run import LOOPBACK_ADDRESS, MasterPlan, run_master  # noqa: PLC0415 - the same

        protocol = protocol_called(self._type.removeprefix(_MASTER))
        folder = self._authority or default_authority_folder()
        watched = any(sniff for _, sniff in self._agents.values())
        with errors_in_python([one.name for one in fields(MasterPlan)]):
            asked = MasterPlan(folder, self._listen or LOOPBACK_ADDRESS, protocol=protocol, **plan)
            return run_master(asked, observer=observer, watched=watched).outcome

    def _join(self) -> dict[str, Ending]:
        from concurrent.futures import ThreadPoolExecutor  # noqa: PLC0415 - robots' machines only

        if not self._main or not self._agents:
            raise ValueError(
                "the container has no agents or no master: call add_agent(name, file)"
                " and set_main_container(host) first"
            )
        with ThreadPoolExecutor(len(self._agents)) as pool:
            running = {name: pool.submit(self._robot, name) for name in self._agents}
            return {name: robot.result() for name, robot in running.items()}

    def _robot(self, name: str) -> Ending:
        from robochoc.communication.network.robot_settings import RobotSettings  # noqa: PLC0415 - an extra
        from robochoc.run.networked.join import PATIENCE_S, identity_of, join  # noqa: PLC0415 - the same
        from robochoc.solver.compile import Compiler  # noqa: PLC0415 - the same

        file, sniff = self._agents[name]
        if file is None or file.stem != name:
            raise ValueError(f"the file of {name} must be called {name}.xml, not {file}")
        robot = read_robot(file)
        identity = identity_of(name, self._main[0], *self._identities.get(name, (None, None)))
        with errors_in_python(("identity",)), Compiler() as compiler:
            return join(robot, self._main, identity, RobotSettings(PATIENCE_S, sniffed=sniff), compiler)


def protocol_called(word: str) -> str:
    """Return the installed name of the protocol in a type of the paper: `abt` for `ABT`.

    Raises `UnknownProtocolError`.
    """
    for offer in installed_protocols():
        if offer.protocol and word.casefold() in {offer.name.casefold(), offer.protocol.__name__.casefold()}:
            return offer.name
    raise UnknownProtocolError(f"no protocol {word!r} is installed; 'robochoc protocols' lists them")
