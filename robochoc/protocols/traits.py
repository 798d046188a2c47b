"""What a protocol is and what it can take: its row in `robochoc protocols`."""

from __future__ import annotations

from dataclasses import dataclass

from robochoc.model.outcome import Verdict

ENDS_WITH_PROOF = (Verdict.NO_SOLUTION,)
"""Solutions are found by falling quiet; one robot alone can only tell that there is none."""
ENDS_WITH_EITHER = (Verdict.SOLUTION, Verdict.NO_SOLUTION)
"""One robot sees either end of the search, such as the last that a token comes to."""
UNDECLARED = (Verdict.SOLUTION, Verdict.NO_SOLUTION, Verdict.UNKNOWN)
"""What a protocol may conclude that does not say. Never `optimal`: a run says that, of a `solution` that it proves."""


@dataclass(frozen=True)
class Traits:
    """Declared by each protocol's class as `traits`; the run refuses what is not declared, in one sentence.

    `paper`: who published it, and when. `complete`: it ends on every problem, with a solution or a proof that there
    is none. `synchronous`: one robot acts at a time. `costs`: it minimises (a DisWCSP). `n_ary`: constraints
    may be over more than two robots. `partially_known`: it takes PKC constraints. `everywhere`: its order changes
    during the search, so each robot of a constraint's scope has to know the constraint, and not only the lowest.
    `beyond`: its robots also write to robots that they share no constraint with; where they do not, access control
    across machines keeps them from it. `tree`: it works on a pseudo-tree. `dynamic`: it goes on when the problem
    changes (then it is a `DynamicProtocol`). `concludes`: the verdicts with which one robot alone may end the search;
    whoever claims another is refused. `tables`: it computes with tables of floats, and refuses costs that could add up
    to 2^53 or more (`solver/exact.py`). `privacy`: what neighbours do not come to know.
    """

    paper: str = ""
    complete: bool = True
    synchronous: bool = False
    costs: bool = False
    n_ary: bool = True
    partially_known: bool = False
    everywhere: bool = False
    beyond: bool = True
    tree: bool = False
    dynamic: bool = False
    concludes: tuple[Verdict, ...] = UNDECLARED
    tables: bool = False
    privacy: str = ""

    def fault_of_conclusion(self, verdict: str) -> str:
        """Return why no robot of this protocol ends the search with `verdict`; empty if one may.

        One rule for the protocol's own code, for the parent of processes, and for the master across machines.
        """
        if verdict in self.concludes:
            return ""
        may = " and ".join(self.concludes) or "nothing"
        said = verdict if verdict in set(Verdict) else "what is no verdict"
        return f"it has concluded {said}, and a robot of this protocol concludes {may} alone (Traits.concludes)"
