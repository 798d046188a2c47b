"""Particle Swarm Functional DCOP (PFD).

For real variables: robots move a swarm of particles through the whole intervals. Each robot has one part of every
particle: positions and velocities of its own variables. In each cycle, robots send their positions to the neighbours
that compute costs, the costs of all particles are added up on the way to the root of a breadth-first tree, and the
root sends back which particles are better than before. So every robot moves its part of each particle towards the best
position of this particle, and the best position of all particles.

- **When to use**: real variables (functional DCOPs), to compare with other protocols. On grids that are refined around
  the answer, they find better answers.
- **Guarantees**: incomplete; it stops after `cycles` cycles, or before if an assignment costs nothing. The cost of the
  best position never rises (anytime). A cycle takes one message for each edge of the constraint graph, and two for each
  edge of the tree; with k particles, messages contain k positions or costs.
- **Parameters (`--set`)**: `particles` (default 30), `cycles` (default 100), `w` (inertia, default 0.72), `c1` and `c2`
  (attraction by the particle's best position, and by that of all particles, default 1.49).
- **Reference**: Choudhury, Mahmud, Khan: "A particle swarm based algorithm for functional distributed constraint
  optimization problems", AAAI 2020 (arXiv 1909.06168). Only the abstract, the introduction and a public summary were
  available: phases and tree are theirs, and the formulas are those of the variant that they name, guaranteed
  convergence PSO (van den Bergh, Engelbrecht: "A new locally convergent particle swarm optimiser", SMC 2002).

The phases:

    initialization    random positions, velocity 0           `_start_swarm`
    evaluation        positions down the order               `Positions`, `_evaluate`
                      costs up the tree                      `Fitness`
    update            better particles down the tree         `Improved`, `_update`
                      velocity and position                  `_move`, `_search_nearby`

The velocity of a particle is v <- w v + c1 r1 (own best - x) + c2 r2 (best of all - x), with random numbers r1 and r2
for each coordinate. The particle with the best position of all searches around it instead, within a radius that is
doubled after 15 successes in a row, and halved after 5 failures.

Choices that the sources leave open, and differences:

- Positions are rounded to the precision before their costs are computed, so costs are exact. A particle stops at the
  end of an interval.
- Variables without real numbers are coordinates too: the rounded coordinate is the index of the value. So any DCOP can
  be solved. The search around the best position may reach each of their values.
- The lowest robot in a constraint computes its cost. Fewer violated hard constraints are always better.
- The first particle begins at the start values of the search, if they are known.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.queens3d import queens3d
>>> result = Simulation(queens3d(3), PFD, Concurrent(seed=0)).search()
>>> result.metrics.messages["Fitness"], len(result.assignments)
(800, 9)
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Final, assert_never, cast

import msgspec

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols import message as wire
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import Proof, Reception, can_take
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.shared.anytime import BreadthFirstTree, Place
from robochoc.protocols.shared.cycles import CycleCount
from robochoc.protocols.traits import ENDS_WITH_PROOF, Traits
from robochoc.protocols.wording import Wording, cost_text
from robochoc.solver.local_problem import LexicographicCost, LocalProblem
from robochoc.solver.points import Point
from robochoc.system.compiling import mypyc_attr
from robochoc.system.plain_text import counted

MOST_PARTICLES: Final = 10_000
MOST_FACTOR: Final = 10
SUCCESSES: Final = 15
"""The number of better positions in a row after which the radius is doubled."""
FAILURES: Final = 5
"""The number of cycles in a row without a better position after which the radius is halved."""
FIRST_RADIUS: Final = 0.25
"""The radius of the search around the best position, as a share of the interval."""

Natural = Annotated[int, msgspec.Meta(ge=0)]


class PFDSettings(CycleCount, frozen=True):
    """`particles`: the size of the swarm. `cycles`: the number of evaluations of all particles.

    `w`: the share of the velocity that is left in the next cycle. `c1`: the attraction by the best position of the
    particle, `c2`: by the best position of all particles.
    """

    particles: int = 30
    w: float = 0.72
    c1: float = 1.49
    c2: float = 1.49

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= self.particles <= MOST_PARTICLES:
            raise ValueError(f"particles is {self.particles}; it must be from 1 to {MOST_PARTICLES:,}")
        for name, number in (("w", self.w), ("c1", self.c1), ("c2", self.c2)):
            if not 0 <= number <= MOST_FACTOR:
                raise ValueError(f"{name} is {number:g}; it must be from 0 to {MOST_FACTOR}")


class Positions(wire.Message, frozen=True):
    """The sender's value in each particle."""

    values: list[wire.Value]

    act = Act(Performative.INFORM, "the receiver learns values whose costs it computes")

    def in_words(self, words: Wording) -> str:
        first = words.own_value(self.values[0]) if self.values else "none"
        return f"my values in {counted(len(self.values), 'particle')}, the first: {first}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [can_take(reception.sender, value) for value in dict.fromkeys(self.values)]


class Fitness(wire.Message, frozen=True):
    """For each particle, the number of violated hard constraints and the cost in the sender's subtree."""

    costs: list[tuple[Natural, int | float]]

    act = Act(Performative.INFORM, "the receiver learns the cost of each particle in the sender's subtree")
    proves_nothing = True  # the costs are sums over many robots

    def in_words(self, _: Wording) -> str:
        if not self.costs:
            return "there are no particles"
        broken, cost = min(self.costs)
        violated = f", and it violates {counted(broken, 'constraint')}" if broken else ""
        return f"the cheapest particle costs my subtree {cost_text(cost)}{violated}"


class Improved(wire.Message, frozen=True):
    """The particles whose last positions are their best ones, and the particle with the best position of all so far.

    `best` is None if the best position of all is not a new one. `last`: the search has ended.
    """

    particles: list[Natural]
    best: Natural | None
    last: bool

    act = Act(Performative.INFORM, "the receiver learns which positions to remember")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        better = f"{counted(len(self.particles), 'particle')} improved"
        best = "the best position is an older one" if self.best is None else f"particle {self.best} is the best so far"
        return f"{better}; {best}{'; the search has ended' if self.last else ''}"


class Particle:
    """One robot's part of a particle: a coordinate and a velocity on each axis, and the best position."""

    def __init__(self, position: list[float]) -> None:
        self.position = position
        self.velocity = [0.0] * len(position)
        self.best = [*position]


@mypyc_attr(allow_interpreted_subclasses=True)
class PFD(Protocol):
    """One agent of PFD.

    State: its part of the `particles`, the `cycle`, the number of the `best` particle with this robot's part of the
    best position of all (`best_position`), and the `radius` of the search around it. The root also has the least costs
    so far, of each particle (`least`) and of all.
    """

    messages: ClassVar[Any] = Place | Positions | Fitness | Improved
    settings: ClassVar[PFDSettings] = PFDSettings()
    traits: ClassVar[Traits] = Traits(
        concludes=ENDS_WITH_PROOF,
        paper="Choudhury, Mahmud, Khan 2020",
        complete=False,
        costs=True,
        continuous=True,
        writes_to_non_neighbours=False,
        privacy="constraints of others, but for sums",
        use_when="real variables, particles instead of grids",
    )

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
        super().__init__(problem, order)
        own = order.rank[problem.agent]
        self.tree = BreadthFirstTree(problem.agent, problem.neighbours, order)
        self.points = problem.points()
        self.particles: list[Particle] = []
        self.cycle = -1
        self.best = 0
        self.best_position: list[float] = []
        self.radius = FIRST_RADIUS
        self.least: list[LexicographicCost] = []
        self._least: LexicographicCost | None = None
        self._run = 0
        """The number of successes in a row; negative: of failures."""
        self._now: list[Point] = []
        self._is_over = False
        self._is_evaluated = True
        self._below = [name for name in problem.neighbours if order.rank[name] > own]
        self._positions: dict[str, deque[list[wire.Value]]] = {
            name: deque() for name in problem.neighbours if order.rank[name] < own
        }
        self._costs: dict[str, list[LexicographicCost]] = {}

    def start(self) -> None:
        """Start to build the tree; a robot without values ends the search."""
        if not self.problem.values and not self.points.is_real:
            self.conclude(Verdict.NO_SOLUTION)
        elif not self.problem.neighbours:
            self._start_swarm()
            self.settle()
        else:
            for name, place in self.tree.start():
                self.send(name, place)

    def receive(self, sender: str, message: wire.Message) -> None:
        """Build the tree, or store positions, costs and improvements; evaluate and move once all have arrived."""
        if self.verdict is not None:
            return
        match cast("Place | Positions | Fitness | Improved", message):
            case Place() as place:
                for name, answer in self.tree.receive(sender, place):
                    self.send(name, answer)
                if self.tree.height is not None and self.cycle < 0:
                    self._start_swarm()
            case Positions(values):
                self._store_positions(sender, values)
            case Fitness(costs):
                self._store_costs(sender, costs)
            case Improved() as improved:
                self._check_improved(sender, improved)
                self._update(improved)
            case never:
                assert_never(never)

    def settle(self) -> None:
        """Evaluate the particles as soon as all positions from above and costs from below have arrived."""
        while self.verdict is None and not self._is_evaluated and self._has_all():
            self._is_evaluated = True
            self._evaluate()

    def _has_all(self) -> bool:
        return all(self._positions.values()) and all(name in self._costs for name in self.tree.children)

    def _store_positions(self, sender: str, values: list[wire.Value]) -> None:
        if sender not in self._positions or len(values) != self.settings.particles or len(self._positions[sender]) > 1:
            raise ValueError(
                f"{sender} sent unexpected positions, or not {counted(self.settings.particles, 'particle')}"
            )
        for value in dict.fromkeys(values):
            self.problem.refuse_value(sender, value)
        self._positions[sender].append(values)

    def _store_costs(self, sender: str, costs: list[LexicographicCost]) -> None:
        is_child = sender in self.tree.children or self.tree.height is None
        if not is_child or sender in self._costs or len(costs) != self.settings.particles:
            raise ValueError(
                f"{sender} sent unexpected costs, or not of {counted(self.settings.particles, 'particle')}"
            )
        if not all(0 <= cost < INFINITE for _, cost in costs):
            raise ValueError(f"{sender} sent invalid costs of particles")
        self._costs[sender] = costs

    def _check_improved(self, sender: str, improved: Improved) -> None:
        """Raise `ValueError` for improvements that no robot may send now."""
        if sender != self.tree.parent or not self._is_evaluated or self._is_over or self.cycle < 0:
            raise ValueError(f"{sender} sent unexpected improvements")
        best = improved.best
        if any(one >= self.settings.particles for one in (*improved.particles, best or 0)):
            raise ValueError(f"{sender} sent an improvement of a particle that does not exist")
        if best is None and not self.best_position:
            raise ValueError(f"{sender} sent no best particle for the first positions")

    def _start_swarm(self) -> None:
        """Place all particles at random, the first one at the start values."""
        for _ in range(self.settings.particles):
            self.particles.append(Particle([self.chance() * most for most in self.points.highest]))
        start = self.problem.start
        if start is not None:
            self.particles[0] = Particle([*self.points.position(start)])
        self._send_positions()

    def _send_positions(self) -> None:
        """Start a cycle: send this robot's values to the neighbours that compute costs with them."""
        self.cycle += 1
        self._is_evaluated = False
        self._now = [self.points.nearest(one.position) for one in self.particles]
        message = Positions([point.value for point in self._now])
        for name in self._below:
            self.send(name, message)

    def _evaluate(self) -> None:
        """Add the costs of this robot to those of its subtree; send the sums to the parent, or compare them."""
        above = {name: positions.popleft() for name, positions in self._positions.items()}
        sums: list[LexicographicCost] = []
        for number, point in enumerate(self._now):
            view = {name: values[number] for name, values in above.items()}
            broken, cost = self.problem.cost_at(point, view)
            for costs in self._costs.values():
                broken, cost = broken + costs[number][0], cost + costs[number][1]
            sums.append((broken, cost))
        self._costs = {}
        if self.tree.parent is None:
            self._compare(sums)
        else:
            self.send(self.tree.parent, Fitness(sums))

    def _compare(self, sums: list[LexicographicCost]) -> None:
        """As the root, find the particles that have improved, and the best one."""
        first = not self.least
        better = [number for number, cost in enumerate(sums) if first or cost < self.least[number]]
        self.least = [*sums] if first else [min(pair) for pair in zip(sums, self.least, strict=True)]
        least = min(sums)
        best = None
        if self._least is None or least < self._least:
            self._least, best = least, sums.index(least)
        last = self.cycle + 1 >= self.settings.cycles or self._least == (0, 0)
        self._update(Improved(better, best, last))

    def _update(self, improved: Improved) -> None:
        """Remember the better positions, pass the message down the tree, and move all particles."""
        for child in self.tree.children:
            self.send(child, improved)
        for number in improved.particles:
            self.particles[number].best = [*self.particles[number].position]
        if improved.best is not None:
            self.best = improved.best
            self.best_position = [*self.particles[self.best].position]
            self.value = self.problem.adopt(self._now[self.best])
        self._adapt_radius(is_success=improved.best is not None)
        self._is_over = improved.last
        if self._is_over:
            return
        for number, particle in enumerate(self.particles):
            if number == self.best:
                self._search_nearby(particle)
            else:
                self._move(particle)
        self._send_positions()

    def _adapt_radius(self, *, is_success: bool) -> None:
        self._run = max(self._run, 0) + 1 if is_success else min(self._run, 0) - 1
        if self._run > SUCCESSES:
            self.radius, self._run = min(2 * self.radius, 1.0), 0
        elif -self._run > FAILURES:
            self.radius, self._run = self.radius / 2, 0

    def _move(self, particle: Particle) -> None:
        """Move a particle towards its best position, and the best position of all."""
        for axis, now in enumerate(particle.position):
            own, common = self.settings.c1 * self.chance(), self.settings.c2 * self.chance()
            pull = own * (particle.best[axis] - now) + common * (self.best_position[axis] - now)
            self._shift(particle, axis, self.settings.w * particle.velocity[axis] + pull)

    def _search_nearby(self, particle: Particle) -> None:
        """Move the best particle to a random position near the best position."""
        for axis, now in enumerate(particle.position):
            reach = max(self.radius * self.points.highest[axis], self.points.nearby[axis])
            pull = self.best_position[axis] - now + reach * (1 - 2 * self.chance())
            self._shift(particle, axis, self.settings.w * particle.velocity[axis] + pull)

    def _shift(self, particle: Particle, axis: int, velocity: float) -> None:
        """Move a particle on one axis; at the end of the interval it stops."""
        wanted = particle.position[axis] + velocity
        reached = min(max(wanted, 0.0), float(self.points.highest[axis]))
        particle.position[axis] = reached
        particle.velocity[axis] = velocity if reached == wanted else 0.0
