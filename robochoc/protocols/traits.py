"""Properties and capabilities of a protocol: its row in the list printed by `robochoc protocols`."""

from __future__ import annotations

from importlib.util import find_spec

from robochoc.model.outcome import Verdict
from robochoc.system.lazy_dataclass import dataclass

ENDS_WITH_PROOF = (Verdict.NO_SOLUTION,)
"""Solutions are detected by quiescence; one robot alone can only prove that there is none."""
ENDS_WITH_EITHER = (Verdict.SOLUTION, Verdict.NO_SOLUTION)
"""One robot decides either result of the search, for example the last robot that a token reaches."""
UNDECLARED = (Verdict.SOLUTION, Verdict.NO_SOLUTION, Verdict.UNKNOWN)
"""The default of `concludes`. It never contains `optimal`: a run reports `optimal` for a `solution` with a proof."""


@dataclass(frozen=True)
class Traits:
    """The declared properties of a protocol (`traits` of its class). A run refuses features that are not declared.

    Attributes:
        paper: The authors and the year of publication.
        complete: It terminates on every problem, with a solution or a proof that there is none.
        synchronous: One robot acts at a time.
        costs: It minimises costs (a DCOP).
        upper_bound: It can begin with a known upper bound of the cost, and then searches for lower costs only. If there
            are none, it concludes that there is no solution (`LocalProblem.upper_bound`).
        n_ary: Constraints may be over more than two robots.
        partially_known: It accepts partially known constraints (PKC).
        asymmetric: The parts of partially known constraints may have costs: each side pays its own part, and the sum is
            minimised.
        shared_scopes: Every robot in a constraint's scope knows the constraint, because the order of the robots changes
            during the search. Otherwise only the lowest robot in the scope knows it.
        writes_to_non_neighbours: Its robots also send messages to robots with which they share no constraint. If it is
            false, access control across machines blocks such messages.
        tree: It works on a pseudo-tree.
        dynamic: It continues when the problem changes (then it is a `DynamicProtocol`).
        concludes: The verdicts with which one robot alone may end the search. Other verdicts are refused.
        tables: It computes with tables of floats, and refuses costs that could add up to 2^53 or more
            (`solver/exact_costs.py`).
        wide_tables: Its tables have a dimension for each robot of the pseudo-tree's width: if one such protocol is
            refused for memory, so are the others.
        encrypted_tables: Its tables have a ciphertext for each cell and each cost. It is for small problems only, and
            is not suggested as an alternative to other protocols.
        secret_keys: Its robots draw secret keys (`Protocol.secret`), so a run across machines cannot be replayed.
        no_replay: The reason why its runs can never be replayed; empty if they can.
        needs: A required module of an extra, and the command to install it. A run is refused if the module is missing.
        counts: Its robots also count the optima, or the solutions if there are no costs (`--count`).
        fronts: Its robots find the Pareto front of several objectives.
        arrays: It has an array implementation that runs a whole team at once (`communication/arrays`).
        continuous: Its robots choose real numbers anywhere in their intervals, so grids are not refined.
        bears_loss: It continues when messages are lost in transit (`Protocol.miss`, `Protocol.go_on`).
        allocates: It accepts only task allocations: teams whose only shared constraints are that a task is done by at
            most one robot, and in which each robot may do none (`solver/exclusions.py`).
        congestion: It also accepts task allocations in which several robots may do a task, at a cost for each pair.
        drops_only: The protocol accepts only constraints that are dropped when a robot is absent (`model/absence.py`).
            Its robots withdraw one after the other, so earlier decisions could break a restated constraint.
        cost_never_rises: The cost never rises from one cycle of the search (`CycleProtocol`) to the next, if no message
            is lost. Violated hard constraints count first.
        optimal_groups: If no robot has changed its value in the last cycle, no group of this size can lower the
            cost together: a size, or the name of the setting with the size. 0: this is not guaranteed.
        share_of_optimum: The profit of an allocation of one task to each robot is at least this share of the maximum.
            0: there is no guarantee.
        privacy: The information that neighbours do not receive.
        use_when: A short recommendation, for `robochoc protocols`.
    """

    paper: str = ""
    complete: bool = True
    synchronous: bool = False
    costs: bool = False
    upper_bound: bool = False
    n_ary: bool = True
    partially_known: bool = False
    asymmetric: bool = False
    shared_scopes: bool = False
    writes_to_non_neighbours: bool = True
    tree: bool = False
    dynamic: bool = False
    concludes: tuple[Verdict, ...] = UNDECLARED
    tables: bool = False
    wide_tables: bool = False
    encrypted_tables: bool = False
    secret_keys: bool = False
    no_replay: str = ""
    needs: tuple[str, str] | None = None
    counts: bool = False
    fronts: bool = False
    arrays: bool = False
    continuous: bool = False
    bears_loss: bool = False
    allocates: bool = False
    congestion: bool = False
    drops_only: bool = False
    cost_never_rises: bool = False
    optimal_groups: int | str = 0
    share_of_optimum: float = 0.0
    privacy: str = ""
    use_when: str = ""

    @property
    def lacks(self) -> str:
        """Return the missing dependency and how to install it, as text; empty if nothing is missing."""
        if self.needs is None or find_spec(self.needs[0]) is not None:
            return ""
        return f"{self.needs[0]}, which is not installed; run: {self.needs[1]}"

    def conclusion_error(self, verdict: str) -> str:
        """Return an error text if no robot of this protocol may end the search with `verdict`; otherwise empty.

        The protocol itself, the parent process of the robots, and the master across machines all apply this rule.
        """
        if verdict in self.concludes:
            return ""
        may = " and ".join(self.concludes) or "nothing"
        concluded = verdict if verdict in set(Verdict) else "an invalid verdict"
        return f"it has concluded {concluded}, but a robot of this protocol may conclude only {may} (Traits.concludes)"
