"""Properties and capabilities of a protocol: its row in `robochoc protocols`."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec

from robochoc.model.outcome import Verdict

ENDS_WITH_PROOF = (Verdict.NO_SOLUTION,)
"""Solutions are found by falling quiet; one robot alone can only tell that there is none."""
ENDS_WITH_EITHER = (Verdict.SOLUTION, Verdict.NO_SOLUTION)
"""One robot sees either end of the search, such as the last that a token comes to."""
UNDECLARED = (Verdict.SOLUTION, Verdict.NO_SOLUTION, Verdict.UNKNOWN)
"""The default of `concludes`. It never contains `optimal`: a run reports that for a `solution` with a proof."""


@dataclass(frozen=True)
class Traits:
    """The declared properties of a protocol (`traits` of its class). A run refuses what is not declared.

    Attributes:
        paper: The authors and the year of publication.
        complete: It ends on every problem, with a solution or a proof that there is none.
        synchronous: One robot acts at a time.
        costs: It minimises costs (a DisWCSP).
        n_ary: Constraints may be over more than two robots.
        partially_known: It takes partially known constraints (PKC).
        asymmetric: Their parts may cost something: each side pays what its own part says, and the sum is minimised.
        shared_scopes: Every robot of a constraint's scope knows the constraint, because the order of the robots changes
            during the search. Otherwise only the lowest robot of the scope knows it.
        writes_to_non_neighbours: Its robots also write to robots that they share no constraint with. Where they do not,
            access control across machines prevents it.
        tree: It works on a pseudo-tree.
        dynamic: It continues when the problem changes (then it is a `DynamicProtocol`).
        concludes: The verdicts with which one robot alone may end the search. Other verdicts are refused.
        tables: It computes with tables of floats, and refuses costs that could add up to 2^53 or more
            (`solver/exact_costs.py`).
        wide_tables: Its tables have a dimension for each robot of the pseudo-tree's width: where one such protocol is
            refused for memory, so are the others.
        encrypted_tables: Its tables have a cipher for each cell and each cost. It takes small problems only, and is not
            named as an alternative to other protocols.
        secret_keys: Its robots draw keys (`Protocol.secret`). A run across machines cannot be replayed then.
        needs: A module of an extra that it computes with, and how to install that. A run without it is refused.
        counts: Its robots also count the optima, or without costs the solutions (`--count`).
        arrays: It has a form for whole teams at once (`communication/arrays`).
        bears_loss: It goes on when messages are lost on their way (`Protocol.miss`, `Protocol.go_on`).
        allocates: It takes task allocations only: teams that share nothing but that some things are done by one robot
            at most, and in which each robot can do without (`solver/exclusions.py`).
        congestion: Of those it also takes such in which several robots may do a task, each pair of them at a cost.
        drops_only: The protocol accepts only constraints that are dropped when a robot is absent (`model/absence.py`).
            Its robots withdraw one after the other, so earlier decisions could break a restated constraint.
        privacy: The information that neighbours do not get.
        use_when: A short recommendation, for `robochoc protocols`.
    """

    paper: str = ""
    complete: bool = True
    synchronous: bool = False
    costs: bool = False
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
    needs: tuple[str, str] | None = None
    counts: bool = False
    arrays: bool = False
    bears_loss: bool = False
    allocates: bool = False
    congestion: bool = False
    drops_only: bool = False
    privacy: str = ""
    use_when: str = ""

    @property
    def lacks(self) -> str:
        """Return what has to be installed first, in words; empty: nothing."""
        if self.needs is None or find_spec(self.needs[0]) is not None:
            return ""
        return f"{self.needs[0]}, which is not installed; say: {self.needs[1]}"

    def fault_of_conclusion(self, verdict: str) -> str:
        """Return why no robot of this protocol may end the search with `verdict`; empty if one may.

        The protocol's own code, the parent of processes, and the master across machines use this one rule.
        """
        if verdict in self.concludes:
            return ""
        may = " and ".join(self.concludes) or "nothing"
        said = verdict if verdict in set(Verdict) else "what is no verdict"
        return f"it has concluded {said}, and a robot of this protocol concludes {may} alone (Traits.concludes)"
