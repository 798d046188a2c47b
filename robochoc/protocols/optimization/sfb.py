"""Synchronous Forward Bounding (SFB), with many partial assignments at a time.

Complete branch and bound for minimum cost. A current partial assignment (CPA) goes from robot to robot in priority
order, as in SyncBB. The costs of robots without a value are bounded from below, as in AFB. Here the CPA itself
contains, for each of these robots, the cost of each of its values so far, as in partial forward checking. A robot that
takes a value adds the costs of the constraints that it shares with them; all robots in a scope know the constraint. So
the holder knows the bound without requests for estimates, and prunes before it sends.

- **When to use**: costs; it is the default for such problems. It needs few messages.
- **Guarantees**: complete; it terminates with an optimum, or with a proof that there is no solution. Memory is bounded
  (`memory`).
- **Parameters (`--set`)**: `batch` (default 4096), `window` (default 1), `memory` (default 64 MiB); see `SFBSettings`.
- **References**: Hirayama, Yokoo: "Distributed partial constraint satisfaction problem", CP 1997 (SyncBB); Gershman,
  Meisels, Zivan: "Asynchronous forward bounding for distributed COPs", JAIR 34, 2009 (AFB); partial forward checking:
  Freuder, Wallace: "Partial constraint satisfaction", AIJ 58, 1992; Larrosa, Meseguer, Schiex: "Maintaining reversible
  DAC for Max-CSP", AIJ 107, 1999.

The methods and messages correspond to AFB's procedures:

    assign_CPA   `_extend`       backtrack      `_explored`
    CPA_MSG      `CPAs`          NEW_SOLUTION   `Solution`

Batches are an addition by this project: one message contains many CPAs, all of the same robots. The first CPAs are sent
one at a time, until a first solution is found. Then each robot doubles the number of CPAs that it extends each time, up
to `batch` and `memory`, the lowest bounds first. The search remains depth first, batch by batch. One robot acts at a
time. If `window` is 2 or more, robots extend the next CPAs while lower robots work on the last ones, an idea from
concurrent search (Zivan, Meisels: "Concurrent search for distributed CSPs", AIJ 170, 2006). In measurements on two
cores this gained nothing.

The course of a search: first, two waves exchange the domains of all robots. The first goes down the order; the second
comes back up, with the charges of the values and an upper bound on all costs. The last robot turns CPAs into solutions.
A solution that is cheaper than all before goes up the order, and every robot stores its value in this solution; CPAs
carry its cost down. When the first robot has nothing left to extend, the last solution is optimal, or there is none.

For the proof, and a comparison with other protocols, see the documentation, page SFB.

Without costs, a value is either consistent or not, so CPAs contain bits instead of costs (`sfb_bits`). The rest is the
same.

Constraints may be n-ary: the second-last robot in a scope adds the costs that the last one will pay. Costs are read
from tables that are computed before the search (see `LocalProblem.tables`), so the search itself makes no constraint
checks. Only constraints over three or more robots whose tables would be too large are evaluated during the search, for
the rows of a batch at once. Without costs they are refused.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> from robochoc.solver.agent_problem import RunParameters
>>> result = Simulation(queens3d(4), SFB, Concurrent(seed=0), parameters=RunParameters(withdrawal_cost=1)).run()
>>> sum(bool(values) for values in result.assignments.values())  # of 16, and no more can fly
10
>>> result.findings["Robot1.1"].bound
6
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, assert_never, cast

from robochoc.model.outcome import Verdict
from robochoc.protocols.findings import NO_FINDINGS, Findings, Incumbent
from robochoc.protocols.message import Message
from robochoc.protocols.optimization.run_lengths import RunLengths, appended, expanded, fits, prepended
from robochoc.protocols.optimization.sfb_bits import ForwardBits
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.solver.encoding import Cost
from robochoc.solver.exact_costs import EXACT, check_exact
from robochoc.solver.local_problem import LocalProblem

if TYPE_CHECKING:
    from robochoc.protocols.optimization.sfb_bounds import ForwardBounds

    Bounds = ForwardBounds | ForwardBits
from collections.abc import Iterator

from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import (
    FINITE,
    INFINITE,
    HasOnly,
    HasValue,
    Pays,
    Proof,
    Reception,
    Total,
    View,
    partial_assignment,
)
from robochoc.protocols.message import Value
from robochoc.protocols.optimization.run_lengths import Run, cut_off
from robochoc.protocols.settings import Settings
from robochoc.protocols.wording import Wording, along, cost_text, incumbent_text
from robochoc.system.compiling import mypyc_attr
from robochoc.system.plain_text import counted, listed

MIB = 1 << 20


class SFBSettings(Settings, frozen=True):
    """Limits on the CPAs that are extended and sent at once.

    `batch`: the maximum number of CPAs that are extended at once. `window`: the maximum number of CPA messages of each
    robot that are sent and not yet explored. `memory`: the bytes that the CPAs in all these messages of all robots may
    take together.

    Each message has the same share of the memory: memory / (robots * window), 4 MiB at most. Only a message with a
    single CPA may take more. CPAs that do not fit are not extended yet, or wait at the robot that has extended them (at
    most one share, or the extensions of a single CPA). With less memory there are more messages, and the verdict is the
    same. The total traffic is not bounded: it is as large as the search. The first waves are not bounded either: their
    messages grow with the number of different domains and charges.
    """

    batch: int = 4096
    window: int = 1
    memory: int = 64 * MIB

    def __post_init__(self) -> None:
        if self.batch < 1 or self.window < 1 or self.memory < 1:
            raise ValueError("batch, window and memory must be 1 or more")


Domain = tuple[Value, ...]
Charges = tuple[float, ...]


class Above(Message, frozen=True):
    """The domains of all robots above the receiver: distinct `domains`, and `runs` of robots with the same domain."""

    domains: list[Domain]
    runs: list[Run]

    act = Act(Performative.INFORM, "the receiver learns the domains above it")

    def in_words(self, words: Wording) -> str:
        domains = expanded(self.domains, cut_off(self.runs, len(words.order)))
        return f"above you there are {_sizes(words.order, domains)}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        domains = expanded(self.domains, cut_off(self.runs, len(reception.order)))
        return [HasOnly(robot, tuple(values)) for robot, values in zip(reception.order, domains, strict=False)]


class Below(Message, frozen=True):
    """The domains and charges of all robots below the receiver; `runs` map robots to the distinct entries.

    `most` is an upper bound on the sum of these charges and of the constraints whose lowest two robots are below.
    """

    domains: list[Domain]
    charges: list[Charges]
    runs: list[Run]
    most: int

    act = Act(Performative.INFORM, "the receiver learns the domains and charges below it")

    def in_words(self, words: Wording) -> str:
        domains = expanded(self.domains, cut_off(self.runs, len(words.order)))
        if not domains:
            return "nobody is below me"
        order = list(words.order)
        names = order[order.index(words.receiver) + 1 :] if words.receiver in order else []
        return f"below you there are {_sizes(names, domains)}; all together they cost at most {cost_text(self.most)}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        below = reception.order[reception.order.index(reception.receiver) + 1 :]
        found: list[Proof] = []
        told = expanded(list(zip(self.domains, self.charges, strict=True)), cut_off(self.runs, len(below)))
        for robot, (values, charges) in zip(below, told, strict=False):
            paid = [Pays(robot, value, {}, cost, cost) for value, cost in zip(values, charges, strict=True)]
            found += [HasOnly(robot, tuple(values)), *paid]
        return found


class CPAs(Message, frozen=True):
    """A number (`count`) of partial assignments of all robots above the receiver (see `sfb_bounds`).

    Their lower bounds are below `least`: the cost of the best known solution, or the `ceiling`, an upper bound on all
    costs.
    """

    count: int
    rows: bytes
    least: int
    ceiling: int

    act = Act(Performative.PROPOSE, "partial assignments, for the receiver to extend or to drop")

    def in_words(self, words: Wording) -> str:
        known = incumbent_text(self.least if self.least < self.ceiling else math.inf)
        return f"{counted(self.count, 'partial assignment')} for {words.receiver} to extend; {known}"

    def proves(self, reception: Reception) -> Sequence[Proof] | None:
        # Each row contains the costs of the robots from the receiver on.
        if self.count > MOST_ROWS:
            return None
        if reception.minimises:
            return [*costs_prove(self.rows, self.count, self.ceiling, reception)]
        return [*bits_prove(self.rows, self.count, reception)]


class Explored(Message, frozen=True):
    """The end of the exploration of the oldest unanswered `CPAs` from the receiver."""

    act = Act(Performative.INFORM, "the partial assignments proposed with `CPAs` have been explored")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "nothing is left of the oldest partial assignments that I have had from you and have not answered"


class Solution(Message, frozen=True):
    """A solution cheaper than all before, as the index of each robot's value in its domain."""

    cost: int
    places: list[int]

    shareable = True
    act = Act(Performative.INFORM, "the receiver learns a solution that costs less")

    def in_words(self, _: Wording) -> str:
        places = listed([str(place + 1) for place in self.places])
        return (
            f"a solution costs {cost_text(self.cost)}, less than all before;"
            f" by number, robots' values in it are {places}"
        )

    def proves(self, reception: Reception) -> Sequence[Proof]:
        view = _chosen(reception.order, self.places, reception)
        return [*(HasValue(*one) for one in view.items()), Total(view, self.cost)]


def _sizes(names: Sequence[str], domains: Sequence[Domain]) -> str:
    return listed([f"{name} ({counted(len(values), 'value')})" for name, values in along(names, domains)]) or "nobody"


def _chosen(robots: Sequence[str], places: Sequence[int], reception: Reception) -> dict[str, Value]:
    """Return the values of robots whose domains the receiver knows."""
    known = [(robot, reception.values(robot), place) for robot, place in zip(robots, places, strict=False)]
    return {robot: values[place] for robot, values, place in known if values is not None}


MOST_ROWS = 2_000
"""Messages with more rows give no proofs: computing them would take too long."""
_SIZES = (1, 2, 4, 8)
_COST, _VALUES = 1, 2


def costs_prove(content: bytes, count: int, ceiling: int, reception: Reception) -> Iterator[Proof]:
    """Yield the proofs in rows of costs. Raises `ValueError` if `content` has another form."""
    rank, domains = _known(reception)
    largest = max(2 * ceiling, *map(len, domains))
    size = next(size for size in _SIZES if largest < 1 << 8 * size - (size == _SIZES[-1]))
    columns = _VALUES + rank + sum(map(len, domains[rank:]))
    if len(content) != count * columns * size:
        raise ValueError(f"{len(content)} bytes cannot contain {count} rows")
    for start in range(0, len(content), columns * size):
        cells = [
            int.from_bytes(content[start + at * size : start + (at + 1) * size], "little") for at in range(columns)
        ]
        view = _view(cells[_VALUES : _VALUES + rank], reception, domains)
        yield Total(view, cells[_COST])
        at = _VALUES + rank
        for robot, values in zip(reception.order[rank:], domains[rank:], strict=True):
            for value in values:
                cost = INFINITE if cells[at] >= ceiling else cells[at]
                yield Pays(robot, value, view, cost, cost)
                at += 1


def bits_prove(content: bytes, count: int, reception: Reception) -> Iterator[Proof]:
    """Yield the proofs in rows of bits. Raises `ValueError` if `content` has another form."""
    rank, domains = _known(reception)
    largest = max(map(len, domains))
    size = 1 if largest <= 1 << 8 else 2 if largest <= 1 << 16 else 4
    length = rank * size + (sum(len(values) + 1 for values in domains[rank:]) + 7) // 8
    if len(content) != count * length:
        raise ValueError(f"{len(content)} bytes cannot contain {count} rows")
    for start in range(0, len(content), length):
        row = content[start : start + length]
        places = [int.from_bytes(row[at * size : (at + 1) * size], "little") for at in range(rank)]
        view = _view(places, reception, domains)
        yield from partial_assignment(list(view), list(view.values()))
        left = int.from_bytes(row[rank * size :], "little")
        for robot, values in zip(reception.order[rank:], domains[rank:], strict=True):
            for value in values:
                least, most = (0.0, FINITE) if left & 1 else (INFINITE, INFINITE)
                yield Pays(robot, value, view, least, most)
                left >>= 1
            left >>= 1


def _known(reception: Reception) -> tuple[int, list[Sequence[Value]]]:
    """Return the receiver's rank, and the values of all robots, as received."""
    domains = [reception.values(robot) for robot in reception.order]
    known = [values for values in domains if values is not None]
    if len(known) < len(domains):
        raise ValueError("received rows before the values of all robots")
    return reception.order.index(reception.receiver), known


def _view(places: Sequence[int], reception: Reception, domains: Sequence[Sequence[Value]]) -> View:
    return {robot: values[at] for robot, values, at in zip(reception.order, domains, places, strict=False)}


LARGEST = 4 * MIB
"""The maximum size of the CPAs in a message, unless there is only one: runtimes have limits, too."""


class Batch:
    """The content of one message: `rows` have yet to be extended; `ready` rows are extended, and wait to be sent.

    `sent` is the number of messages with extended rows that are not yet explored.
    """

    def __init__(self, rows: Any, bounds: Bounds) -> None:  # noqa: ANN401 - rows of either form
        self.rows = rows
        self.ready = rows[:0]
        self.sent = 0
        self._bounds = bounds

    @property
    def left(self) -> bool:
        """True if some rows have not been sent yet."""
        return bool(len(self.rows) or len(self.ready))

    @property
    def bound(self) -> int | None:
        """The minimum lower bound of the rows that have not been sent yet; None if there are no such rows."""
        return min((self._bounds.least(rows) for rows in (self.rows, self.ready) if len(rows)), default=None)

    def take(self, count: int, upper_bound: int) -> Any:  # noqa: ANN401 - as above
        """Remove the next `count` rows and return those with a lower bound below `upper_bound`."""
        rows, self.rows = self.rows[:count], self.rows[count:]
        return self._bounds.below(rows, upper_bound)

    def part(self, count: int, upper_bound: int) -> Any:  # noqa: ANN401 - as above
        """Return the next `count` ready rows with a lower bound below `upper_bound`; the others keep waiting."""
        rows = self._bounds.below(self.ready, upper_bound)
        self.ready = rows[count:]
        return rows[:count]


class KnownSolution:
    """A solution of the robots in `order`, whose `domains` are known: checked and spelt out once for a whole process.

    The robots of a simulation receive the same object (`Message.shareable`). For each robot to do this would take
    quadratic time and memory in all.
    """

    def __init__(self, solution: Solution, order: PriorityOrder, domains: RunLengths[Domain]) -> None:
        self.solution = solution
        self.order = order
        self._domains = domains
        self._incumbent: Incumbent | None = None
        self.fits = self._fits()

    @property
    def incumbent(self) -> Incumbent:
        """The values of all robots."""
        if self._incumbent is None:
            domains = expanded(self._domains.distinct, self._domains.runs)
            chosen = zip(self.order.names, domains, self.solution.places, strict=True)
            values = {name: values[place] for name, values, place in chosen}
            self._incumbent = Incumbent(self.solution.cost, values)
        return self._incumbent

    def _fits(self) -> bool:
        """Return whether each robot has a value at its place."""
        places, start = self.solution.places, 0
        if len(places) != len(self._domains):
            return False
        for domain, count in self._domains.counted(0, len(places)):
            part = places[start : start + count]
            if min(part) < 0 or max(part) >= len(domain):
                return False
            start += count
        return True


_last_known: KnownSolution | None = None
"""The last solution that a robot in this process has received or found."""


@mypyc_attr(allow_interpreted_subclasses=True)
class SFB(Protocol):
    """One agent. State: the `batches` to explore, the oldest first, and the `best` solution.

    - `domains`: those of this robot and the robots above, then those of all robots.
    - `upper_bound`: the cost of the best solution.
    - `under_way`: for each unanswered message to the next robot, its batch and its minimum lower bound.
    - `width`: the number of CPAs to extend next. `first_sent`: the first CPA was sent, alone.
    - `bounds`: the costs that this robot adds to CPAs; set once it knows the values of all robots, complete with the
      `ceiling`.
    """

    bounds: Bounds
    messages: ClassVar[Any] = Above | Below | CPAs | Explored | Solution
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Hirayama & Yokoo 1997; Gershman, Meisels, Zivan 2009",
        synchronous=True,
        costs=True,
        upper_bound=True,
        shared_scopes=True,
        tables=True,
        use_when="what auto mostly takes, with or without costs: few messages",
    )
    settings: ClassVar[SFBSettings] = SFBSettings()

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        self.rank = order.rank[problem.agent]
        self.previous = order.names[self.rank - 1] if self.rank else None
        self.next = order.names[self.rank + 1] if self.rank + 1 < len(order.names) else None
        self.domains: RunLengths[Domain] = RunLengths([], [])
        self.best: Solution | None = None
        self.upper_bound = self.ceiling = 0
        self.batches: deque[Batch] = deque()
        self.under_way: deque[tuple[Batch, int]] = deque()
        self.width = 1
        self.first_sent = False

    def start(self) -> None:
        """Send the values, as the first robot; a robot with an empty domain ends the search."""
        if not self.problem.values:
            self.conclude(Verdict.NO_SOLUTION)
        elif self.previous is None:
            self._send_domains([], [])
            self.settle()
        if self.problem.values and not self.problem.has_costs:
            self.problem.look_ahead()

    def receive(self, sender: str, message: Message) -> None:
        """Process one message. Raises `ValueError` for a message that is not possible at this point."""
        if self.verdict is not None:
            return
        received = cast("Above | Below | CPAs | Explored | Solution", message)
        if not self._expects(sender, received):
            raise ValueError(f"unexpected {type(message).__name__} from {sender}")
        match received:
            case Above(domains, runs):
                self._send_domains(domains, runs)
            case Below() as below:
                self._send_charges(below)
            case CPAs() as cpas:
                self._process_cpas(cpas)
            case Explored():
                batch, _ = self.under_way.popleft()
                batch.sent -= 1
            case Solution() as solution:
                self._process_solution(solution)
            case never:
                assert_never(never)

    def _expects(self, sender: str, message: Above | Below | CPAs | Explored | Solution) -> bool:
        """Return whether `sender`, the robot before or the next one, may send `message` at this point."""
        match message:
            case Above(domains, runs):
                fitting = fits(len(domains), runs, self.rank)
                return sender == self.previous and not self.domains and fitting
            case Below(domains, charges, runs, most):
                alike = len(domains) == len(charges) and all(map(_same_length, domains, charges))
                alike = alike and most >= 0 and all(_is_charge(charge) for row in charges for charge in row)
                fitting = alike and fits(len(domains), runs, len(self.order.names) - self.rank - 1)
                return sender == self.next and bool(self.domains) and not self._priced and fitting
            case CPAs(_, _, least, ceiling):
                return sender == self.previous and self._priced and least >= 0 and 0 < ceiling <= EXACT
            case Explored():
                return sender == self.next and bool(self.under_way)
            case Solution():
                return sender == self.next and self._priced and self._known(message).fits
            case never:
                assert_never(never)

    @property
    def _priced(self) -> bool:
        """True if the values of all robots are known, and the constraints with them have been evaluated."""
        return hasattr(self, "bounds")

    def settle(self) -> None:
        """Extend CPAs while messages may be sent; report explored batches."""
        while self.batches and self.verdict is None:
            batch = next((batch for batch in self.batches if batch.left), None)
            if not self.batches[0].left and not self.batches[0].sent:
                self.batches.popleft()
                self._explored()
            elif batch is not None and len(self.under_way) < self.settings.window:
                self._extend(batch)
            else:
                return

    # Before the search

    def _send_domains(self, domains: list[Domain], runs: list[Run]) -> None:
        above = Above(*appended(domains, runs, self.problem.values))
        self.domains = RunLengths(above.domains, above.runs)
        if self.next is None:
            self._send_charges(Below([], [], [], 0))
        else:
            self.send(self.next, above)

    def _send_charges(self, below: Below) -> None:
        """Store the values of all robots and evaluate the constraints; the first robot then begins the search."""
        own = self.problem.values, tuple(map(_as_integer, self.problem.costs({})))
        self.domains = self.domains.followed_by(below.domains, below.runs)
        self.bounds = self._create_bounds(self.domains)
        most = below.most + self.bounds.most + max_finite(own[1])
        check_exact(most)
        if self.previous is not None:
            kinds, runs = prepended(own, [*zip(below.domains, below.charges, strict=True)], below.runs)
            self.send(self.previous, Below([kind[0] for kind in kinds], [kind[1] for kind in kinds], runs, most))
        else:
            self._count_up_to(most + 1)
            self.upper_bound = int(min(self.upper_bound, self.problem.upper_bound))
            charges = [own[1], *expanded(below.charges, below.runs)]
            self.batches.append(Batch(self.bounds.nothing(charges), self.bounds))

    def _create_bounds(self, domains: RunLengths[Domain]) -> Bounds:
        if self.problem.has_costs:
            from robochoc.protocols.optimization.sfb_bounds import ForwardBounds  # noqa: PLC0415 - start-up: numpy

            return ForwardBounds(self.problem, self.order, domains)
        return ForwardBits(self.problem, self.order, domains)

    def _count_up_to(self, ceiling: int) -> None:
        self.bounds.count_up_to(ceiling)
        self.upper_bound = self.ceiling = ceiling

    # The search

    def _process_cpas(self, cpas: CPAs) -> None:
        """Store the received CPAs and their upper bound."""
        if not self.ceiling:
            self._count_up_to(cpas.ceiling)
        self.upper_bound = min(self.upper_bound, cpas.least)
        self.batches.append(Batch(self.bounds.read(cpas.rows, cpas.count), self.bounds))

    def _extend(self, batch: Batch) -> None:
        """Extend the next CPAs if none are ready, and send those that may lead to a cheaper solution."""
        if self.next is None:
            self._complete(batch.take(len(batch.rows), self.upper_bound))
            return
        fit = max(1, self.share // self.bounds.width)
        if not len(batch.ready):
            many = max(1, fit // len(self.problem.values))
            batch.ready = self.bounds.extended(batch.take(min(self.width, many), self.upper_bound), self.upper_bound)
            self.width = min(2 * self.width, self.settings.batch)
        rows = batch.part(fit if self.first_sent else 1, self.upper_bound)
        if len(rows):
            self.first_sent = True
            batch.sent += 1
            self.under_way.append((batch, self.bounds.least(rows)))
            self.send(self.next, CPAs(len(rows), self.bounds.packed(rows), self.upper_bound, self.ceiling))

    @property
    def share(self) -> int:
        """The bytes that one message of CPAs may take."""
        return min(LARGEST, self.settings.memory // (len(self.order.names) * self.settings.window))

    def _complete(self, rows: Any) -> None:  # noqa: ANN401 - of either form
        """Complete the CPAs, as the last robot; the cheapest is a solution if it costs less than the best so far."""
        if len(rows):
            cost, places = self.bounds.completed(rows)
            if cost < self.upper_bound:
                self._process_solution(Solution(cost, places))

    def _process_solution(self, solution: Solution) -> None:
        """Store this robot's value in a cheaper solution, and send the solution on to the robots above."""
        self.best = solution
        self.upper_bound = solution.cost
        self.value = solution.places[self.bounds.rank]
        if self.previous is not None:
            self.send(self.previous, solution)

    def _explored(self) -> None:
        """Report the oldest batch as explored; for the first robot, the search is over."""
        if self.previous is not None:
            self.send(self.previous, Explored())
        elif self.best is None:
            self.conclude(Verdict.NO_SOLUTION)

    # Knowledge about the whole search

    @property
    def incumbent(self) -> Incumbent | None:
        """The best solution that this robot knows."""
        return None if self.best is None else self._known(self.best).incumbent

    def _known(self, solution: Solution) -> KnownSolution:
        """Return the object for `solution` that the robots in this process share."""
        global _last_known  # noqa: PLW0603 - robots in a process share nothing else that is theirs
        known = _last_known
        if known is None or known.solution is not solution or known.order is not self.order:
            known = _last_known = KnownSolution(solution, self.order, self.domains)
        return known

    @property
    def findings(self) -> Findings:
        """The best known solution; for the first robot also the minimum lower bound of all unexplored CPAs."""
        if not self.ceiling:
            return NO_FINDINGS
        bound = None
        if self.previous is None:
            left = [batch.bound for batch in self.batches if batch.bound is not None]
            bound = min([self.upper_bound, *left, *(least for _, least in self.under_way)])
        return Findings(self.incumbent, bound)


def _as_integer(cost: Cost) -> Cost:
    """Return `cost` as an integer if it is finite: integers take fewer bytes in a message."""
    return cost if cost == math.inf else int(cost)


def _is_charge(cost: Cost) -> bool:
    """Return whether `cost` is infinite, or an integer of 0 or more."""
    return cost == math.inf or (cost >= 0 and cost == int(cost))


def max_finite(charges: Sequence[float]) -> int:
    """Return the largest finite charge."""
    return int(max((charge for charge in charges if charge < math.inf), default=0))


def _same_length(domain: Domain, charges: Charges) -> bool:
    return len(domain) == len(charges)
