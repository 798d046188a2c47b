"""The rules by which a protocol is chosen for a team (`run/choice.py`), and their thresholds.

`RULES` are tried from the first to the last. The measurements behind them: docs/guides/which-protocol.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from robochoc.model.orders import Order
from robochoc.run.facts import Facts
from robochoc.solver.encoding import MAX_TUPLES
from robochoc.solver.filters import MAX_FILTER_BITS

NARROW_CELLS = 4_000_000
"""The largest number of entries of a table on a narrow pseudo-tree."""
FEW_ROBOTS = 6
"""Up to this number of robots every protocol takes milliseconds, and `sfb` needs the fewest messages."""
MOST_IN_A_TREE = 30_000
"""The largest team that uses a tree. The simulator needs half a minute for it (docs/guides/large-teams.md)."""
MANY_ROBOTS = 300
"""With more robots, for problems with costs only local search ends in time."""
MANY_COMBINATIONS = 100_000_000
"""Up to this many combinations of the values of all robots, `asym-pt-fb` takes seconds in the simulator."""
EASY = 0.48
"""The constrainedness up to which robots that search at the same time find a solution after few changes."""
HARD = 0.68
"""The constrainedness from which `sfb` saves more messages than it takes time for each of them."""
DENSE = 0.6
"""The share of linked pairs from which a small part of the team may already have no assignment without costs."""
FREE = 0.5
"""The constrainedness, of the problem without any costs, up to which such an assignment is likely."""
LARGE_PAIR = 10_000
"""The entries of a constraint's table from which `sfb` takes long for each message: two robots with 100 values."""
NEARLY_ALL = 0.9
"""The share of linked pairs from which only `sfb` backtracks early enough (queens)."""
SMALL_TEAM = 12
"""Up to this number of robots, the computations before the search count more than the search."""
HARD_SMALL = (0.8, 1.3)
"""Between these, the same as `HARD` for up to `SMALL_TEAM` robots: with more, a contradiction is found soon."""
LARGE_TEAM = 100
"""With more robots, a search by one robot after the other takes longer than one by all at the same time."""
HARD_LARGE = 0.8
"""The same as `HARD` for more than `LARGE_TEAM` robots."""
FEW_TO_BEGIN_ANEW = 25
"""Up to this many robots, `sfb` decides hard problems in the files' order, which dynamic problems keep."""
TIGHT = 0.7
"""The constrainedness from which `sfb`, restarted after each change, needs fewer messages than `dynabt`."""
LONG_ROW = 65_536
"""Up to this many values of all robots together, many of SFB's partial assignments fit into one message."""

FEW_LOSSES = 0.1
"""The share of lost messages up to which `gdba` finds more solutions than `dsa`, whose robots move without a gain."""


class Condition(NamedTuple):
    """A condition of a rule on a team: a predicate, and a text for each of its two results."""

    holds: Callable[[Facts], bool]
    text: str
    otherwise: str


class Rule(NamedTuple):
    """A rule of `auto`: a protocol, the conditions on the team, the reason, and the order that suits the protocol.

    `order` is None if the order of the files is kept.
    """

    protocol: str
    conditions: tuple[Condition, ...]
    why: str
    order: Order | None = None

    def unmet(self, facts: Facts) -> str:
        """Return why the rule does not apply: the first condition that the team does not meet. Empty if it applies."""
        return next((one.otherwise for one in self.conditions if not one.holds(facts)), "")


def _at_most(robots: int) -> Condition:
    return Condition(
        lambda f: f.robots <= robots, f"at most {robots:,} robots", f"there are more than {robots:,} robots"
    )


def _more_than(robots: int) -> Condition:
    return Condition(
        lambda f: f.robots > robots, f"more than {robots:,} robots", f"there are {robots:,} robots or fewer"
    )


COSTS = Condition(lambda f: f.has_costs, "costs", "there are no costs")
NO_COSTS = Condition(lambda f: not f.has_costs, "no costs", "there are costs")
CHANGES = Condition(lambda f: f.changes, "a problem that changes", "the problem does not change")
PARTIAL = Condition(
    lambda f: f.partially_known, "partially known constraints (PKC)", "no constraint is partially known (PKC)"
)
FORBIDS_NOTHING = Condition(lambda f: not f.forbids, "nothing is forbidden", "some constraints forbid something")
LARGE_TABLE = Condition(
    lambda f: f.largest_table > MAX_TUPLES,
    f"a constraint of more than {MAX_TUPLES:,} combinations of values",
    f"no constraint has more than {MAX_TUPLES:,} combinations of values",
)
MORE_THAN_FEW = _more_than(FEW_ROBOTS)
NO_WITHDRAWAL = Condition(lambda f: not f.withdrawal, "no --withdraw", "robots may withdraw")
NOT_COMPLETE = Condition(
    lambda f: (
        f.robots <= SMALL_TEAM or f.share_linked < NEARLY_ALL or max(f.largest_pair, f.declared_table) > LARGE_PAIR
    ),
    f"at most {SMALL_TEAM} robots, or less than {NEARLY_ALL:.0%} of all pairs linked, or more than 100 values",
    f"{NEARLY_ALL:.0%} or more of all pairs of robots are linked",
)
NO_CROWD = Condition(
    lambda f: f.crowd is None,
    "no group of robots that need more different values than they have",
    "a group of robots needs more different values than it has",
)
ANY_SOLUTION = (NO_COSTS, NO_WITHDRAWAL, MORE_THAN_FEW, NOT_COMPLETE)
NOT_HARD = Condition(
    lambda f: f.constrainedness < (HARD_LARGE if f.robots > LARGE_TEAM else HARD),
    f"a constrainedness below {HARD} (more than {LARGE_TEAM} robots: {HARD_LARGE})",
    f"the constrainedness is {HARD} or more (more than {LARGE_TEAM} robots: {HARD_LARGE})",
)
LOSSY = Condition(lambda f: f.loss > 0, "messages may be lost", "no message is lost")
NEARLY_A_TREE = (
    COSTS,
    MORE_THAN_FEW,
    _at_most(MOST_IN_A_TREE),
    Condition(
        lambda f: f.tree.cells <= NARROW_CELLS,
        f"tables of at most {NARROW_CELLS:,} entries on the pseudo-tree",
        f"a table on the pseudo-tree would have more than {NARROW_CELLS:,} entries",
    ),
)

RULES = (
    Rule(
        "maxsum",
        (
            LOSSY,
            COSTS,
            FORBIDS_NOTHING,
            Condition(lambda f: f.largest_table <= MAX_TUPLES, "domains that are not large", "domains are large"),
        ),
        "messages may be lost: it continues with the latest ones received, and ends at lower costs than others that do",
    ),
    Rule(
        "regret-matching",
        (LOSSY, COSTS),
        "messages may be lost, and it depends on no single one; with hard constraints it finds the most solutions",
    ),
    Rule(
        "acls",
        (LOSSY, PARTIAL),
        "messages may be lost, and constraints are partially known: it supports both, and ends at the lowest costs",
    ),
    Rule(
        "gdba",
        (
            LOSSY,
            Condition(
                lambda f: f.loss <= FEW_LOSSES,
                f"at most {FEW_LOSSES:.0%} of them",
                f"more than {FEW_LOSSES:.0%} of the messages are lost",
            ),
        ),
        "messages may be lost, and it continues without them; of the protocols that do, it finds the most solutions",
    ),
    Rule(
        "dsa",
        (LOSSY,),
        "many messages may be lost: its robots decide by the latest values received",
    ),
    Rule(
        "dba", (LOSSY, NO_COSTS), "messages may be lost, and other protocols that tolerate it do not accept the options"
    ),
    Rule(
        "disfc",
        (
            PARTIAL,
            Condition(
                lambda f: f.largest_domain <= MAX_FILTER_BITS,
                f"at most {MAX_FILTER_BITS:,} values in a domain",
                f"a domain has more than {MAX_FILTER_BITS:,} values, too many for its filters",
            ),
        ),
        "constraints are partially known: it supports them, and sends no value",
    ),
    Rule("abt", (PARTIAL,), "constraints are partially known, and it supports them"),
    Rule(
        "acls",
        (
            PARTIAL,
            COSTS,
            Condition(
                lambda f: math.prod(f.sizes.values()) > MANY_COMBINATIONS,
                f"more than {MANY_COMBINATIONS:,} combinations of all values",
                f"there are {MANY_COMBINATIONS:,} combinations of all values or fewer",
            ),
            FORBIDS_NOTHING,
        ),
        "both sides of partially known constraints have costs, and there are too many combinations for a proof: local"
        " search ends, with a good answer",
    ),
    Rule(
        "asym-pt-fb", (PARTIAL, COSTS), "both sides of partially known constraints have costs; it proves the best sum"
    ),
    Rule(
        "sfb",
        (
            CHANGES,
            NO_COSTS,
            Condition(lambda f: not f.environment, "changes that files name", "an environment changes the problem"),
            _at_most(FEW_TO_BEGIN_ANEW),
            Condition(
                lambda f: f.constrainedness >= TIGHT,
                f"a constrainedness of {TIGHT} or more",
                f"the constrainedness is below {TIGHT}",
            ),
            Condition(
                lambda f: f.largest_table <= MAX_TUPLES and f.values <= LONG_ROW,
                "domains that are not large",
                "domains are large",
            ),
        ),
        "the problem changes and is hard: restarted each time, it needs fewer messages than a protocol that continues",
    ),
    Rule(
        "dynabt",
        (CHANGES, NO_COSTS),
        "the problem changes, and it keeps what still holds",
    ),
    Rule(
        "s-dpop",
        (CHANGES, *NEARLY_A_TREE),
        "costs change, and the constraint graph is nearly a tree: it keeps the tables that still hold",
    ),
    Rule(
        "ncbb",
        (
            COSTS,
            MORE_THAN_FEW,
            Condition(lambda f: not f.changes, "a problem that does not change", "the problem changes"),
            _at_most(MANY_ROBOTS),
            Condition(
                lambda f: f.share_linked < DENSE,
                f"less than {DENSE:.0%} of all pairs linked",
                f"{DENSE:.0%} or more of all pairs of robots are linked",
            ),
            Condition(
                lambda f: f.cost_constrainedness < FREE,
                f"a constrainedness below {FREE} if nothing may cost anything",
                f"the constrainedness is {FREE} or more if nothing may cost anything",
            ),
        ),
        "an assignment without costs is likely: the search ends with it",
    ),
    Rule(
        "dpop",
        NEARLY_A_TREE,
        "its tables on a pseudo-tree are small, and its messages few",
    ),
    Rule(
        "dsa",
        (
            COSTS,
            _more_than(MANY_ROBOTS),
            FORBIDS_NOTHING,
        ),
        "there are too many robots for a proof, and nothing is forbidden: local search ends, with a good answer",
    ),
    Rule(
        "sbt",
        (
            *ANY_SOLUTION,
            Condition(
                lambda f: f.needs_no_backtracking,
                "parents that leave each robot a value, in the order of the files",
                "in the order of the files, a robot's parents may leave it no value",
            ),
        ),
        "in the order of the files, parents leave each robot a value: one robot after the other chooses, each once",
    ),
    Rule(
        "abt",
        (
            *ANY_SOLUTION,
            Condition(
                lambda f: f.constrainedness < EASY,
                f"a constrainedness below {EASY}",
                f"the constrainedness is {EASY} or more",
            ),
            Condition(
                lambda f: f.robots <= SMALL_TEAM or f.is_binary,
                f"at most {SMALL_TEAM} robots, or no constraint over more than two",
                f"there are more than {SMALL_TEAM} robots, and constraints over more than two",
            ),
            NO_CROWD,
        ),
        "constraints exclude little: robots that search at the same time soon agree, also in the order of the files",
    ),
    Rule(
        "sbt",
        (
            *ANY_SOLUTION,
            _at_most(SMALL_TEAM),
            Condition(
                lambda f: not HARD_SMALL[0] <= f.constrainedness < HARD_SMALL[1],
                f"a constrainedness below {HARD_SMALL[0]}, or of {HARD_SMALL[1]} or more",
                f"the constrainedness is from {HARD_SMALL[0]} to {HARD_SMALL[1]}",
            ),
            Condition(
                lambda f: f.constrainedness >= HARD_SMALL[1] or f.crowd is None,
                f"{NO_CROWD.text}, or a constrainedness of {HARD_SMALL[1]} or more",
                NO_CROWD.otherwise,
            ),
        ),
        "there are few robots: it computes nothing before the search",
        Order.MAX_DEGREE,
    ),
    Rule(
        "abt",
        (*ANY_SOLUTION, NOT_HARD, NO_CROWD),
        "constraints do not exclude much: robots search at the same time, with short messages",
        Order.MAX_DEGREE,
    ),
    Rule(
        "afc-ng",
        (
            NO_COSTS,
            Condition(
                lambda f: f.declared_values > LONG_ROW or f.declared_table > MAX_TUPLES,
                f"more than {LONG_ROW:,} values in all, or {LARGE_TABLE.text}",
                f"there are {LONG_ROW:,} values in all or fewer, and {LARGE_TABLE.otherwise}",
            ),
        ),
        "domains are large, and it needs no tables",
        Order.MAX_DEGREE,
    ),
    Rule(
        "afb",
        (
            Condition(
                lambda f: f.largest_needed_table > MAX_TUPLES,
                f"{LARGE_TABLE.text} that must be a table: over two robots, a relation, or with div, mod or pow",
                f"no constraint that must be a table has more than {MAX_TUPLES:,} combinations of values",
            ),
        ),
        "domains are large, and it needs no tables",
        Order.MAX_DEGREE,
    ),
    Rule("sfb", (COSTS,), "it needs few messages, on hard problems too", Order.MAX_DEGREE),
    Rule("sfb", (), "it needs few messages, on hard problems too", Order.MIN_WIDTH),
)
"""The rules, in the order in which they are tried."""
