"""Complete Asynchronous Partial Overlay (CompAPO).

Cooperative mediation: a robot in conflict first tries to repair the conflict by changing its own value. If that is
impossible, it mediates: it asks the robots in its good_list (those whose constraints it knows) to keep their values,
solves their common problem by itself, and sends each robot its value. Robots outside the list that are then in conflict
join it. So mediators learn the hard parts of the problem, and in the worst case the whole problem.

- **When to use**: no costs, robots may learn each other's constraints, and messages should be few but may be long.
- **Guarantees**: complete; it terminates with a solution or with a proof that there is none. A mediator's search is
  exponential in its good_list, and tables of n-ary constraints are exponential in their number of robots.
- **Parameters**: none.
- **References**: Mailler, Lesser: "Solving distributed constraint satisfaction problems using cooperative mediation",
  AAMAS 2004 (APO); "Asynchronous partial overlay: a new algorithm for solving distributed constraint satisfaction
  problems", JAIR 25 (2006). APO is not complete: Grinshpoun, Meisels: "Completeness and performance of the APO
  algorithm", JAIR 33 (2008), which is CompAPO. Only digests of the papers were available.

The methods, next to the papers' names:

    init            `_introduce`          evaluate?         `_evaluate`, `_serve`
    check_agent     `_check_agent_view`   evaluate!, wait!  `_evaluated`, `_abandon`
    mediate         `_open`, `_advance`   accept!           `_accept`
    choose_solution `_choose_solution`    good_list         `good_list`

As in CompAPO there are no partial sessions: a mediator continues only once all robots that it asked have agreed. This
project adds a way to terminate under every schedule, without clock or random numbers:

- **Sessions also include the robots around the good_list**: all robots that share a constraint with a robot in it. They
  keep their values, too, so the mediator's knowledge of them is true. They send values, not conflicts.
- **Waiting** follows the wait-die scheme of databases. Priority is as in the paper: the mediator with the larger
  good_list first, then the higher robot. A robot in a session lets requests of higher priority wait, and refuses
  requests of lower priority (`wait!`). A refused mediator releases all robots in its session, and tries again when the
  robot that refused it reports that it is free. So a mediator only waits for sessions of lower priority, and no cycle
  can form. The session of highest priority is never refused, and finishes.
- **Only the highest robot in a conflict acts**, and the number of times that it repairs by itself is at most the size
  of its good_list.

Termination: the number of repairs is bounded, because good_lists are. After the last repair, values change in sessions
only. A session's mediator is in a conflict whose robots are all in the good_list. If no conflict with robots outside
remains, there are fewer conflicts than before, because all robots around kept their values. Otherwise the good_list
grows. So only finitely many sessions change anything. A session whose conflict has disappeared follows a change of
value that had not reached the mediator, and a refused session follows a session of higher priority: there are finitely
many of these, too. At quiescence no robot is the highest in a conflict, so there is no conflict. A mediator whose
good_list has no solution proves that there is none.

APO itself is not offered. In its sessions (only of the robots that agree) values may change in circles for ever: this
happened on 8 of 150 random problems with 6 robots, all of which CompAPO solved. When APO ended, its result was correct.

Other choices and differences:

- A robot's constraints are sent when a mediator first asks for them, not at the start: on easy problems they are never
  sent.
- New values are numbered, so that an old `ok?` never replaces a mediator's decision. A mediator sends the new values to
  all neighbours of the robots that change, so no `ok?` follows an `accept!`.
- The mediator's search and its tables of constraints are in `mediation.py`; its checks are counted.

Privacy: a mediator learns the domain sizes, the constraints and the values of all robots in its good_list, and the
values of the robots around it. In the worst case one robot learns the whole problem.

>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.run import Options, Runtime, solve
>>> outcome = solve(queens3d(4), Options(protocol="compapo", runtime=Runtime.SIMULATOR))
>>> outcome.verdict.value
'no-solution'
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import assert_never, cast

from robochoc.model.outcome import Verdict
from robochoc.protocols import acts
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import FINITE, Clash, HasOnly, HasValue, Pays, Proof, Reception
from robochoc.protocols.message import Message, Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.mediation import AllowedTable, Mediation, allows, distinct, own_tables, sizes_in
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.plain_text import counted, listed

Changes = dict[str, tuple[int, int]]
"""New values of robots: the index in the robot's domain, and the number of changes of its value so far."""
MOST_PROOFS = 4096
"""Constraints with more combinations of values give no proofs, because computing these would take too long."""


class Init(Message, frozen=True):
    """The sender's domain, the first value first (`init`)."""

    values: tuple[Value, ...]

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        return words.domain(self.values)

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [HasOnly(reception.sender, self.values), HasValue(reception.sender, self.values[0], (0,))]


class Ok(Message, frozen=True):
    """The sender's new value, and the number of its changes (`ok?`)."""

    value: Value
    count: int

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} from now on"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [HasValue(reception.sender, self.value, (self.count,))]


class Evaluate(Message, frozen=True):
    """A request to join a mediation session with this priority; with `tables`, to send constraints (`evaluate?`)."""

    session: int
    priority: int
    tables: bool

    act = Act(Performative.REQUEST, "the sender wants to mediate, and needs the receiver to keep its value for now")
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        known = f"I know the constraints of {counted(self.priority, 'robot')}"
        more = "; tell me yours" if self.tables else ""
        return f"let me mediate: keep {words.variables(words.receiver)} until I say more ({known}{more})"


class Evaluation(Message, frozen=True):
    """The permission to mediate: the sender's value, its number of changes, and its constraints if requested.

    The paper's `evaluate!`.
    """

    session: int
    place: int
    count: int
    tables: tuple[AllowedTable, ...]

    act = Act(Performative.AGREE, "the sender keeps its value until the mediation session is over")

    def in_words(self, _: Wording) -> str:
        shown = f"; my constraints are {counted(len(self.tables), 'table')}" if self.tables else ""
        return f"do mediate: I keep my value number {self.place + 1}{shown}"

    def proves(self, reception: Reception) -> Sequence[Proof] | None:
        # The sender's value, and the combinations that its constraints allow.
        if sum(math.prod(table.sizes) for table in self.tables) > MOST_PROOFS:
            return None
        shown = [proof for table in self.tables for proof in _table_proves(table, self.tables, reception)]
        return [*_current_values({reception.sender: (self.place, self.count)}, reception), *shown]


class Wait(Message, frozen=True):
    """The receiver may not mediate now: the sender is in a session of higher priority (`wait!`)."""

    session: int

    act = Act(Performative.REFUSE, "the sender is in a mediation session of higher priority")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "wait with your mediation: another one is going on here that comes first"


class Free(Message, frozen=True):
    """The end of a wait: the sender, which refused the receiver, has left its session."""

    act = Act(Performative.INFORM, "the receiver may ask again to mediate")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "you need not wait for me any more"


class Assign(Message, frozen=True):
    """The end of a session: the receiver's value, and its neighbours' new values (`accept!`)."""

    place: int
    changes: Changes

    act = Act(Performative.REQUEST, "the receiver chooses the value in the message")

    def in_words(self, _: Wording) -> str:
        return f"the mediation is over: take your value number {self.place + 1}{_shown(self.changes)}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        # The sender learns the receiver's value, too.
        agreed = reception.last(Evaluation, reception.receiver, reception.sender)
        count = 0 if agreed is None else agreed.count + (agreed.place != self.place)
        return _current_values({**self.changes, reception.receiver: (self.place, count)}, reception)


class Release(Message, frozen=True):
    """The end of a session for a robot that keeps its value, with its neighbours' new values."""

    changes: Changes

    act = Act(Performative.INFORM, "the receiver may change its value again")

    def in_words(self, words: Wording) -> str:
        return f"the mediation is over: {words.variables(words.receiver)} may change again{_shown(self.changes)}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return _current_values(self.changes, reception)


def _shown(changes: Changes) -> str:
    """Return the new values of others in words; empty if there are none."""
    shown = [f"{robot} now has its value number {place + 1}" for robot, (place, _) in changes.items()]
    return f"; {listed(shown)}" if shown else ""


def _current_values(changes: Changes, reception: Reception) -> list[Proof]:
    """Return the values of robots whose domains the observer knows."""
    known = [(robot, reception.values(robot), place, count) for robot, (place, count) in changes.items()]
    return [HasValue(robot, values[place], (count,)) for robot, values, place, count in known if values is not None]


def _table_proves(table: AllowedTable, tables: Sequence[AllowedTable], reception: Reception) -> Iterator[Proof]:
    """Yield the proofs in one of the sender's `tables`: the values that clash, and those that all constraints allow.

    There are none if the receiver does not know the domains that the indices refer to.
    """
    values = [reception.values(robot) for robot in table.robots]
    if any(known is None for known in values):
        return
    within = [other for other in tables if {*other.robots} <= {*table.robots}]
    for places in itertools.product(*map(range, table.sizes)):
        at = dict(zip(table.robots, places, strict=True))
        view = {robot: known[at[robot]] for robot, known in zip(table.robots, values, strict=True) if known is not None}
        if not table.allows(places):
            yield Clash(view)
        elif all(other.allows(at[robot] for robot in other.robots) for other in within):
            yield Pays(reception.sender, view.pop(reception.sender), view, 0, FINITE)


class CompAPO(Protocol):
    """One agent of CompAPO.

    State: `view` (agent_view), with `counts` of changes; the neighbours' `domains`; `good_list` and `tables`, the
    constraints of the robots in it as far as they are known. `holder` is the mediator of the session that this robot is
    in, and `held` that session's priority; `requests` are sessions that wait, `refused` the robots that it has refused.
    Of its
    own session: its number `session`, the robots `asked`, and `replies`. `waits_for` is the robot that has refused it.
    """

    messages = Init | Ok | Evaluate | Evaluation | Wait | Free | Assign | Release
    traits = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Mailler & Lesser 2004; Grinshpoun & Meisels 2008",
        shared_scopes=True,
        privacy="constraints, until a mediator asks: it learns those of all robots in its good_list",
        use_when="no costs, and robots may learn each other's constraints",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.name = problem.agent
        self.linked = self._ranked({robot for scope, _ in problem.scopes(problem.neighbours) for robot in scope})
        self.view: dict[str, Value] = {}
        self.counts: dict[str, int] = {}
        self.count = 0
        self.domains: dict[str, tuple[Value, ...]] = {}
        self.good_list = {self.name, *self.linked}
        self.tables: dict[str, tuple[AllowedTable, ...]] = {}
        self.repairs = 0
        self.holder: str | None = None
        self.held: tuple[int, int] = (0, 0)
        self.requests: dict[str, Evaluate] = {}
        self.refused: set[str] = set()
        self.session = 0
        self.asked: set[str] = set()
        self.replies: dict[str, Evaluation] = {}
        self.waits_for: str | None = None
        self._conflict: bool | None = None
        """True if this robot is the highest in a conflict; None if not known since the last change."""

    def start(self) -> None:
        """Choose the first value, and send the domain to all neighbours."""
        if not self.problem.values:
            self.conclude(Verdict.NO_SOLUTION)
            return
        self.value = 0
        for neighbour in self.linked:
            self.send(neighbour, Init(self.problem.values))

    def receive(self, sender: str, message: Message) -> None:
        if self.verdict is not None:
            return
        match cast("Init | Ok | Evaluate | Evaluation | Wait | Free | Assign | Release", message):
            case Init(values):
                self._introduce(sender, values)
            case Ok(value, count):
                self._update_value(sender, value, count)
            case Evaluate() as request:
                self.requests[sender] = request
            case Evaluation() as reply:
                self._evaluated(sender, reply)
            case Wait(session):
                self._abandon(sender, session)
            case Free():
                self.waits_for = None if self.waits_for == sender else self.waits_for
            case Assign(place, changes):
                self._accept(sender, place, changes)
            case Release(changes):
                self._release(sender, changes)
            case never:
                assert_never(never)

    def settle(self) -> None:
        """Continue or begin a session, and answer requests. Do nothing before all domains are known."""
        if self.verdict is not None or len(self.domains) < len(self.linked):
            return
        if self.holder == self.name:
            self._advance()
        if self.verdict is None:
            self._serve()

    # Received values

    def _introduce(self, sender: str, values: tuple[Value, ...]) -> None:
        if not values:
            raise ValueError(f"{sender} has no values")
        self.domains[sender] = values
        self._update_value(sender, values[0], 0)

    def _update_value(self, sender: str, value: Value, count: int) -> None:
        """Store a value, unless a newer one is known."""
        if sender in self.domains and count >= self.counts.get(sender, 0):
            self.view[sender], self.counts[sender] = value, count
            self._conflict = None

    def _learn(self, changes: Changes) -> None:
        """Store a mediator's new values of neighbours."""
        for robot, (place, count) in changes.items():
            if robot not in self.domains or not 0 <= place < len(self.domains[robot]):
                raise ValueError(f"{robot} has no known value number {place + 1}")
            self._update_value(robot, self.domains[robot][place], count)

    # In a session of another robot

    def _serve(self) -> None:
        """Agree to the first waiting session, or act alone; then refuse requests and report that this robot is free.

        Requests of lower priority than this robot's current session are refused.
        """
        if self.holder is None and self.requests:
            first = min(self.requests, key=self._priority)
            self.holder, self.held = first, self._priority(first)
            self._evaluate(first, self.requests.pop(first))
        if self.holder is None:
            self._check_agent_view()
        if self.holder is None:
            for robot in self._ranked(self.refused):
                self.send(robot, Free())
            self.refused.clear()
            return
        for robot in self._ranked(self.requests):
            if self._priority(robot) > self.held:
                self.send(robot, Wait(self.requests.pop(robot).session))
                self.refused.add(robot)

    def _evaluate(self, mediator: str, request: Evaluate) -> None:
        """Agree to a session: keep the value, and send it, with the constraints if they were requested."""
        tables = self._own_tables() if request.tables else ()
        self.send(mediator, Evaluation(request.session, self._place(), self.count, tables))

    def _accept(self, mediator: str, place: int, changes: Changes) -> None:
        """Adopt the value from the mediator, which has also sent it to all neighbours."""
        if mediator != self.holder or not 0 <= place < len(self.problem.values):
            raise ValueError(f"{mediator} is not allowed to assign value number {place + 1}")
        if place != self.value:
            self._change(place)
        self._release(mediator, changes)

    def _release(self, mediator: str, changes: Changes) -> None:
        """End the session, or forget the request for a session."""
        self._learn(changes)
        self.requests.pop(mediator, None)
        self.refused.discard(mediator)
        if mediator == self.holder:
            self.holder = None

    # This robot's search

    def _check_agent_view(self) -> None:
        """Repair a conflict by changing the value; otherwise begin to mediate, unless refused."""
        if not self._in_conflict() or self._repair():
            return
        if self.waits_for is None:
            self._open()

    def _in_conflict(self) -> bool:
        """Return whether this robot is the highest in a conflict, and so the one that must act."""
        if self._conflict is None:
            rank = self.order.rank
            conflicts = self.problem.conflicts(self._place(), self.view)
            self._conflict = any(all(rank[robot] > rank[self.name] for robot in seen) for seen, _ in conflicts)
        return self._conflict

    def _repair(self) -> bool:
        """Choose a value without conflicts, and send it to all neighbours; return whether there is one."""
        if self.repairs >= len(self.good_list):
            return False
        places = range(len(self.problem.values))
        against = {place for _, some in self.problem.conflicts_of(places, self.view) for place in some}
        place = next((place for place in places if place not in against), None)
        if place is None:
            return False
        self.repairs += 1
        self._change(place)
        for neighbour in self.linked:
            self.send(neighbour, Ok(self.problem.values[place], self.count))
        return True

    def _open(self) -> None:
        """Start a session."""
        self.holder, self.held = self.name, (-len(self.good_list), self.order.rank[self.name])
        self.session += 1
        self.asked = {self.name}
        self.replies = {self.name: Evaluation(self.session, self._place(), self.count, ())}
        self.tables[self.name] = self._own_tables()
        self._advance()

    def _advance(self) -> None:
        """Send the requests that are missing; once all robots have agreed, solve the problem."""
        if len(self.replies) < len(self.asked):
            return
        around = {robot for table in self._known_tables() for robot in table.robots}
        more = (self.good_list | around) - self.asked
        for robot in self._ranked(more):
            wanted = robot in self.good_list and robot not in self.tables
            self.send(robot, Evaluate(self.session, len(self.good_list), wanted))
        self.asked |= more
        if not more:
            self._apply_replies()
            self._choose_solution()

    def _evaluated(self, sender: str, reply: Evaluation) -> None:
        """Store a reply of the current session."""
        if self.holder != self.name or reply.session != self.session or sender not in self.asked:
            return
        if sender in self.good_list and sender not in self.tables:
            if not reply.tables or not all(
                sender in table.robots and {*table.robots} <= {*self.order.names} for table in reply.tables
            ):
                raise ValueError(f"{sender} sent no constraints, or constraints without it or with unknown robots")
            self.tables[sender] = reply.tables
        self.replies[sender] = reply

    def _abandon(self, sender: str, session: int) -> None:
        """End the session without a result: a robot is in a higher-priority one, and will report when it is free."""
        if self.holder != self.name or session != self.session:
            return
        self.waits_for = sender
        self._end({}, {}, self.asked - {self.name, sender})

    def _apply_replies(self) -> None:
        """Store the neighbours' values from the replies; they are fixed during the session."""
        for robot in self.linked:
            reply = self.replies[robot]
            self._learn({robot: (reply.place, reply.count)})

    def _choose_solution(self) -> None:
        """Solve the problem of the good_list and send the result; robots outside that are in conflict join the list."""
        places = {robot: reply.place for robot, reply in self.replies.items()}
        found = self._solved(places) if self._in_conflict() else {}
        if found is None:
            self.conclude(Verdict.NO_SOLUTION)
            return
        changes = {
            robot: (place, self.replies[robot].count + 1) for robot, place in found.items() if place != places[robot]
        }
        self._end(found, changes, self.asked - {self.name})

    def _solved(self, places: Mapping[str, int]) -> dict[str, int] | None:
        """Return values for the good_list, and add the robots in conflict with them; None if there are none."""
        tables = self._known_tables()
        sizes = sizes_in(tables, places)
        mediation = Mediation(tables, {robot: sizes[robot] for robot in self._ranked(self.good_list)}, places)
        found = mediation.best()
        self.problem.checks += mediation.checks
        if found is not None:
            after = {**places, **found}
            self.good_list.update(*(table.robots for table in tables if not allows(table, after)))
        return found

    def _end(self, found: Mapping[str, int], changes: Changes, held: Iterable[str]) -> None:
        """End the session: send the robots in it (`held`) their values, and the changes of their neighbours."""
        met: dict[str, set[str]] = {}
        for table in self._known_tables() if changes else ():
            for robot in table.robots:
                met.setdefault(robot, set()).update(table.robots)
        for robot in self._ranked(held):
            news = {other: change for other, change in changes.items() if other != robot and other in met[robot]}
            self.send(robot, Assign(found[robot], news) if robot in found else Release(news))
        if self.name in changes:
            self._change(changes[self.name][0])
        self._learn({robot: change for robot, change in changes.items() if robot in self.domains})
        self.holder = None

    # Constraints

    def _own_tables(self) -> tuple[AllowedTable, ...]:
        """Return this robot's constraints; constraints between the same robots are in one table."""
        if self.name not in self.tables:
            self.tables[self.name] = own_tables(self.problem, self.linked, self.domains)
        return self.tables[self.name]

    def _known_tables(self) -> list[AllowedTable]:
        """Return the constraints of the good_list, each once."""
        return distinct(table for robot in self._ranked(self.good_list) for table in self.tables.get(robot, ()))

    # Helpers

    def _change(self, place: int) -> None:
        self.value = place
        self.count += 1
        self._conflict = None

    def _place(self) -> int:
        assert self.value is not None  # noqa: S101 - taken at the start, and only ever exchanged for another
        return self.value

    def _priority(self, robot: str) -> tuple[int, int]:
        """Return the priority of a request; smaller ones come first."""
        return -self.requests[robot].priority, self.order.rank[robot]

    def _ranked(self, robots: Iterable[str]) -> list[str]:
        return sorted(robots, key=self.order.rank.__getitem__)
