"""What a protocol is and what it can take: its row in `robochoc protocols`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Traits:
    """Declared by each protocol's class as `traits`; the run refuses what is not declared, in one sentence.

    `paper`: who published it, and when. `complete`: it ends on every problem, with a solution or a proof that there
    is none. `synchronous`: one robot acts at a time. `costs`: it minimises (a DisWCSP). `n_ary`: constraints
    may be over more than two robots. `partially_known`: it takes PKC constraints. `everywhere`: its order changes
    during the search, so each robot of a constraint's scope has to know the constraint, and not only the lowest.
    `beyond`: its robots also write to robots that they share no constraint with; where they do not, access control
    across machines keeps them from it. `tree`: it works on a pseudo-tree. `dynamic`: it goes on when the problem
    changes (then it is a `DynamicProtocol`). `tables`: it computes with tables of floats, and refuses costs that could
    add up to 2^53 or more (`cost_table.refuse_inexact`). `privacy`: what neighbours do not come to know.
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
    tables: bool = False
    privacy: str = ""
