"""A game in rounds: all players of a team choose values at the same time, and announce them to their neighbours."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import field

from msgspec.structs import asdict

from robochoc.journal.entries import Header
from robochoc.journal.events import Began, Decided, Observer, Received, Sent
from robochoc.journal.recorder import JournalRecorder
from robochoc.journal.team_events import TeamWriter
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import Team
from robochoc.protocols.local_search.rounds import Announced, Claimed, Rounds, Said
from robochoc.protocols.message import Message, encode
from robochoc.rounds.optimum import Optimum, certified_optimum
from robochoc.rounds.team_rounds import TeamRounds
from robochoc.run.defaults import CENTRAL, ROUNDS
from robochoc.run.options import Runtime
from robochoc.seats.command_seats import CommandSeats
from robochoc.seats.moves import Breach, Delivery, Limits, Move, Players, Rule, Seen, Statement, refused_as_player
from robochoc.seats.players import GreedyPlayer, OptimalPlayer, RandomPlayer, ScriptedPlayer
from robochoc.seats.protocol_robots import ProtocolRobots
from robochoc.seats.report import GameReport, Ledger, report_of
from robochoc.seats.words import problem_in_words
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.errors import UnsupportedError
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.plain_text import listed

BUILT_IN = ("random", "greedy", "optimal")
"""The names of the built-in players without arguments."""
MOST_ROUNDS = 1_000_000
"""The maximum number of rounds."""
_SCRIPT = "script:"


@dataclass(frozen=True)
class GameOptions:
    """The options of a game.

    Attributes:
        commands: The command of the outside program for each robot that one plays, as a list of words.
        players: The player of each other robot: `random`, `greedy`, `optimal`, `script:0,2,1` (indices of values), or
            the name of a protocol.
        others: The player of all robots that are not named.
        rounds: The number of rounds, at most `MOST_ROUNDS`.
        seed: The seed of built-in players and protocols.
        limits: The limits on outside programs.
        optimum: The protocol that certifies the optimum; None: no regret.
        coalitions: Groups of robots whose joint regret is reported, besides the robots of all programs.
    """

    commands: Mapping[str, Sequence[str]] = field(default_factory=dict)
    players: Mapping[str, str] = field(default_factory=dict)
    others: str = "dsa"
    rounds: int = 20
    seed: int = 0
    limits: Limits = Limits()
    optimum: str | None = CENTRAL
    coalitions: tuple[tuple[str, ...], ...] = ()


def play(team: Team, options: GameOptions, recorder: JournalRecorder | None = None) -> GameReport:
    """Play a game, and return the report. All outside programs have ended when it returns or raises.

    Args:
        team: The team. A scenario is not supported.
        options: The players, rounds and limits.
        recorder: Records the game, with the header from `header_of`; None: no journal.

    Raises:
        InvalidInputError: if the team is not valid.
        PlayerError: if a player is not known or cannot play, or a program cannot be started.
        UnknownProtocolError: if the protocol that certifies the optimum is not known.
        UnsupportedError: if the options do not fit each other or the team.
    """
    refuse_options(team, options)
    optimum = None if options.optimum is None else certified_optimum(team, options.optimum)
    game = Game(team, options, optimum, recorder)
    report = game.play()
    if recorder:
        recorder.outcome = game.outcome()
    return report


def header_of(team: Team, options: GameOptions) -> Header:
    """Return the header of the journal of a game."""
    return Header(team=team.name, protocol=ROUNDS, runtime=Runtime.SIMULATOR, seed=options.seed)


class Game:
    """A game: the state of the team, its players, and what they did.

    Args:
        team: The team.
        options: The options, which fit the team.
        optimum: The certified optimum; None if it is not computed.
        observer: Receives the events of the game, in which times are numbers of rounds.
        seat: Players of the caller, besides those in the options.

    Attributes:
        rounds: The state of the team.
        report: The report; None before the end of the game.
    """

    def __init__(
        self,
        team: Team,
        options: GameOptions,
        optimum: Optimum | None = None,
        observer: Observer | None = None,
        seat: Players | None = None,
    ) -> None:
        self._team, self._options, self._optimum = team, options, optimum
        self._observer, self._seat = observer, seat
        self.report: GameReport | None = None
        self.rounds = TeamRounds(team)
        self._ledger = Ledger([*self.rounds.problems])
        self._heard: dict[str, list[Delivery]] = {name: [] for name in self.rounds.problems}
        self._kinds: dict[str, str] = {}

    def play(self) -> GameReport:
        """Play all rounds, and return the report."""
        for _ in self.turns():
            pass
        assert self.report is not None  # noqa: S101 - for mypy: all rounds are over
        return self.report

    def turns(self) -> Generator[Mapping[str, Seen], None, None]:
        """Play round by round: before each round, yield what the players of all robots learn before their moves.

        All programs end when the last round is over, or the iterator is closed.
        """
        with self._seated() as players:
            self._report_start()  # not before: a refused game does not overwrite a journal
            self._kinds = {name: one.kind for one in players for name in one.robots}
            for number in range(1, self._options.rounds + 1):
                seen = {name: Seen(number, self.rounds.view(name), self._heard[name]) for name in self.rounds.problems}
                yield seen
                self._play_round(seen, players)
            for one in players:
                one.end(self.rounds)
        self.report = self.report_so_far()

    def report_so_far(self) -> GameReport:
        """Return the report of the rounds that have been played."""
        options = self._options
        outside = tuple(options.commands)
        coalitions = [*options.coalitions, *([outside] if len(outside) > 1 else [])]
        return report_of(
            self._team, self.rounds, self._ledger, self._kinds, self._optimum, coalitions, planned=options.rounds
        )

    def outcome(self) -> Outcome:
        """Return the result of the game, for the journal."""
        cost = self.rounds.user_cost
        return Outcome(
            verdict=Verdict.UNKNOWN if cost is None else Verdict.SOLUTION,
            team=self._team.name,
            protocol=ROUNDS,
            runtime=Runtime.SIMULATOR,
            seed=self._options.seed,
            assignment={} if cost is None else self.rounds.assignment(),
            cost=cost,
        )

    @contextmanager
    def _seated(self) -> Iterator[list[Players]]:
        """Provide the players, and end all programs at the end of the block."""
        options, robots = self._options, self.rounds.problems
        players: list[Players] = [] if self._seat is None else [self._seat]
        taken = {*options.commands, *(name for one in players for name in one.robots)}
        try:
            protocols: dict[str, list[str]] = {}
            for name in robots:
                if name in taken:
                    continue
                chosen = options.players.get(name, options.others)
                with refused_as_player([name]):
                    built_in = self._built_in(name, chosen)
                if built_in is None:
                    protocols.setdefault(chosen, []).append(name)
                else:
                    players.append(built_in)
            for protocol, names in protocols.items():
                with refused_as_player(names):
                    players.append(ProtocolRobots(self.rounds, protocol, names, options.seed, options.rounds))
            if options.commands:
                words = {name: problem_in_words(self._team, name) for name in options.commands}
                players.append(CommandSeats(self.rounds, options.commands, words, options.rounds, options.limits))
            yield players
        finally:
            for one in players:
                one.close()

    def _built_in(self, name: str, chosen: str) -> Players | None:
        """Return the built-in player called `chosen` for a robot; None if there is none."""
        if chosen == "random":
            return RandomPlayer(self.rounds, name, self._options.seed)
        if chosen == "greedy":
            return GreedyPlayer(self.rounds, name)
        if chosen == "optimal":
            return OptimalPlayer(self.rounds, name, self._optimum)
        if chosen.startswith(_SCRIPT):
            return ScriptedPlayer(self.rounds, name, _indices(name, chosen.removeprefix(_SCRIPT)))
        return None

    def _play_round(self, seen: Mapping[str, Seen], players: Iterable[Players]) -> None:
        """Let all players move, then announce their values and deliver their messages."""
        number = next(iter(seen.values())).round
        self._heard = {name: [] for name in self.rounds.problems}
        moves: dict[str, Move] = {}
        for one in players:
            moves |= one.choose({name: seen[name] for name in one.robots})
        values: dict[str, int] = {}
        announced: dict[str, int] = {}
        for name, move in moves.items():
            values[name] = self._value(name, move)
            announced[name] = values[name] if move.announced is None else move.announced
        self.rounds.choose(values, announced)
        for name in self.rounds.problems:
            self._ledger.record(name, number, moves[name], lies=announced[name] != values[name])
            self._publish(name, number, moves[name])
        self._ledger.costs.append(self.rounds.user_cost)

    def _value(self, name: str, move: Move) -> int:
        """Return the value that a robot plays: the one in its move, the previous one, or its cheapest value."""
        if move.value is not None:
            return move.value
        charges = self.rounds.problems[name].charges
        return self.rounds.values.get(name, charges.index(min(charges)))

    def _publish(self, name: str, number: int, move: Move) -> None:
        """Send the announcement and the messages of a robot, and record the events."""
        problem = self.rounds.problems[name]
        if self._observer:
            assignment = problem.solution(self.rounds.values[name])
            self._observer(Decided(t=number, robot=name, assignment=assignment, clock=0))
        for other in problem.neighbours:
            self._send(name, other, number, Announced(self.rounds.announced[name]))
        for one in move.statements:
            self._deliver(name, number, one)

    def _deliver(self, name: str, number: int, one: Statement) -> None:
        """Deliver a text or a claim, unless the robot has used up its characters."""
        left = self._options.limits.characters - self._ledger[name].characters
        if len(one.text) > left:
            breach = Breach(number, Rule.TOO_MANY, f"a text of {len(one.text):,} characters; {left:,} are left")
            self._ledger[name].breach(breach)
            return
        if one.claim is None:
            self._ledger[name].texts += 1
            self._ledger[name].characters += len(one.text)
            self._heard[one.receiver].append(Delivery(name, one.text))
            self._send(name, one.receiver, number, Said(one.text))
            return
        index, cost = one.claim
        value = self.rounds.problems[name].values[index]
        holds = self.rounds.problems[name].charges[index] == cost
        self._ledger.record_claim(name, one.receiver, number, value, cost, holds=holds)
        self._heard[one.receiver].append(Delivery(name, claim=(value, cost)))
        self._send(name, one.receiver, number, Claimed(value, cost, holds))

    def _send(self, sender: str, receiver: str, number: int, message: Message) -> None:
        if not isinstance(message, Claimed) or message.holds:  # a false claim proves nothing, and there may be millions
            self._ledger.disclose(sender, receiver, message)
        size, kind = len(encode(message)), type(message).__name__
        self._ledger[sender].sent(size)
        if self._observer:
            content = asdict(message)
            self._observer(
                Sent(t=number, sender=sender, receiver=receiver, type=kind, content=content, bytes=size, clock=0)
            )
            self._observer(Received(t=number, sender=sender, receiver=receiver, type=kind, clock=0))

    def _report_start(self) -> None:
        if self._observer:
            self._observer(Began(t=0, protocol=Rounds.__name__, minimises=True))
            self._observer(TeamWriter().given(self.rounds.team, RunParameters(self._options.seed)))


def _indices(name: str, text: str) -> list[int]:
    """Return the indices in a script. Raises `UnsupportedError`."""
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise UnsupportedError(f"the script of {name} is {text!r}; write indices of values, such as 0,2,1") from None


def refuse_options(team: Team, options: GameOptions) -> None:
    """Raise `UnsupportedError` if the options do not fit each other or the team."""
    named = {*options.commands, *options.players, *(name for group in options.coalitions for name in group)}
    if missing := sorted(named - {*team.order}):
        raise UnsupportedError(f"{team.name} has no robot {missing[0]!r}; its robots are {listed(team.order)}")
    if both := sorted({*options.commands} & {*options.players}):
        raise UnsupportedError(f"{both[0]} has two players; name one")
    for group in options.coalitions:
        if twice := [name for name in group if group.count(name) > 1]:
            raise UnsupportedError(f"the coalition {','.join(group)} names {twice[0]} twice: name each robot once")
    if not 1 <= options.rounds <= MOST_ROUNDS:
        raise UnsupportedError(f"{options.rounds} rounds: a game has at least 1 and at most {MOST_ROUNDS:,}")
