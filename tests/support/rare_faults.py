"""Faults of protocols that few orders of messages show: each is one change in a source, found on one small team.

`python -m tests.support.rare_faults` measures them again, and prints the rows of the table in
`docs/explanation/rare-orders.md`.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Sequence
from typing import NamedTuple

from robochoc.exploration.check import Case, CheckOptions, case_of, explore
from robochoc.exploration.problems import small_teams
from robochoc.exploration.team_state import Exploration
from robochoc.protocols.protocol import Protocol
from robochoc.run.options import Options, Runtime
from tests.support.changed_protocols import SourceChange, changed_protocol, random_faults

STATES = 2000
"""The maximum number of states that are explored."""
RUNS = 200
"""The number of random runs."""
SEED = 0
"""The seed of the teams."""


class Found(NamedTuple):
    """Measured numbers: the steps that lead to the fault, the states until then, and the random runs with a fault."""

    steps: int
    states: int
    runs: int


class RareFault(NamedTuple):
    """A fault.

    Attributes:
        protocol: The name of the protocol.
        fault: What the changed protocol does.
        change: The change of its source.
        team: The number of robots and of values, as for `robochoc check`, and the number of the random team.
        found: The measured numbers.
    """

    protocol: str
    fault: str
    change: SourceChange
    team: tuple[int, int, int]
    found: Found

    @property
    def name(self) -> str:
        """A name for tests."""
        return f"{self.protocol} {self.fault.replace('`', '')}"

    def case(self) -> tuple[Case, type[Protocol]]:
        """Return the team, and the class of the changed protocol."""
        protocol = changed_protocol(self.protocol, self.change)
        robots, values, number = self.team
        team = next(itertools.islice(small_teams(protocol.traits, robots, values, SEED), number, None))
        return case_of(team, protocol, Options(protocol=self.protocol, runtime=Runtime.SIMULATOR)), protocol

    def explored(self) -> Exploration:
        """Return what `robochoc check` finds."""
        case, protocol = self.case()
        run = Options(protocol=self.protocol, runtime=Runtime.SIMULATOR, seed=SEED)
        return explore(case, CheckOptions(protocol, run, STATES))

    def measured(self) -> Found:
        """Return the numbers of today."""
        found = self.explored()
        assert found.fault, self.name
        return Found(len(found.path), found.states, random_faults(self.case()[0], RUNS))

    def row(self, found: Found) -> str:
        """Return a row of the table."""
        robots, values, number = self.team
        team = f"{robots}, {values}, {number}"
        return f"| `{self.protocol}` | {self.fault} | {team} | {found.steps} | {found.states:,} | {found.runs} |"


_SATISFACTION, _OPTIMIZATION = "robochoc/protocols/satisfaction/", "robochoc/protocols/optimization/"
_ABT, _AFC, _AFC_NG = f"{_SATISFACTION}abt.py", f"{_SATISFACTION}afc.py", f"{_SATISFACTION}afc_ng.py"
_AFC_TREE, _AGILE = f"{_SATISFACTION}afc_tree.py", f"{_SATISFACTION}agile_abt.py"
_ABT_DO, _DISFC, _COMPAPO = f"{_SATISFACTION}abt_do.py", f"{_SATISFACTION}disfc.py", f"{_SATISFACTION}compapo.py"
_ADOPT, _BOUNDING = f"{_OPTIMIZATION}adopt.py", f"{_OPTIMIZATION}bounding.py"
_AFB, _AFB_BOUNDS = f"{_OPTIMIZATION}afb.py", f"{_OPTIMIZATION}afb_bounds.py"


def _fault(
    protocol: str,
    fault: str,
    path: str,
    old: str,
    new: str,
    *,
    team: tuple[int, int, int],
    found: tuple[int, int, int],
) -> RareFault:
    return RareFault(protocol, fault, SourceChange(path, old, new), team, Found(*found))


FAULTS: Sequence[RareFault] = (
    _fault(
        "abt",
        "drops the `ok?` in answer to an obsolete nogood",
        _ABT,
        "and the sender has forgotten this robot's value: send it again.\n            self.send(sender, Ok(current))",
        "and it has forgotten it.\n            pass",
        team=(3, 2, 17),
        found=(9, 38, 26),
    ),
    _fault(
        "abt",
        "believes nogoods that contradict its view",
        _ABT,
        "        if self._coherent(nogood):\n            self._check_add_link",
        "        if True:\n            self._check_add_link",
        team=(4, 3, 68),
        found=(17, 157, 0),
    ),
    _fault(
        "afc",
        "accepts an outdated copy of the CPA",
        _AFC,
        "        if sc <= self.sc:\n            return\n        self.sc = sc",
        "        self.sc = sc",
        team=(4, 3, 6),
        found=(6, 82, 0),
    ),
    _fault(
        "afc",
        "forgets the step counter of the CPA",
        _AFC,
        "        self.sc = max(self.sc, held.sc)\n",
        "",
        team=(4, 3, 77),
        found=(8, 770, 0),
    ),
    _fault(
        "afc-ng",
        "accepts a CPA with an older counter",
        _AFC_NG,
        "            if assignments[first][1] <= known[first][1]:\n                return",
        "            pass",
        team=(4, 3, 19),
        found=(14, 721, 1),
    ),
    _fault(
        "afc-tree",
        "accepts an obsolete `Accept`",
        _AFC_TREE,
        " or counters != [*self.counters, self.counter]",
        "",
        team=(4, 3, 15),
        found=(13, 247, 23),
    ),
    _fault(
        "agile-abt",
        "adopts an outdated order",
        _AGILE,
        "        if (termination, names) >= (self.termination, self.present.names):\n            return\n",
        "        if (termination, names) == (self.termination, self.present.names):\n            return\n",
        team=(4, 3, 27),
        found=(14, 446, 26),
    ),
    _fault(
        "agile-abt",
        "does not repeat its value for a robot that has forgotten it",
        _AGILE,
        "            del self.sent_values[sender]  # the sender has forgotten it; a newer value would be in transit",
        "            pass",
        team=(3, 2, 27),
        found=(12, 148, 4),
    ),
    _fault(
        "agile-abt",
        "does not decide between two orders of equal strength",
        _AGILE,
        "        if (termination, names) >= (self.termination, self.present.names):",
        "        if termination >= self.termination:",
        team=(4, 3, 83),
        found=(13, 1136, 21),
    ),
    _fault(
        "abt-do-retro",
        "drops the `ok?` in answer to an obsolete nogood",
        _ABT_DO,
        "            self.owed.add(sender)  # the sender has forgotten this robot's value\n",
        "",
        team=(3, 2, 10),
        found=(6, 39, 3),
    ),
    _fault(
        "disfc",
        "accepts a nogood against a previous value",
        _DISFC,
        "if self.value is None or nogood.counter != self.counter:",
        "if self.value is None:",
        team=(3, 2, 34),
        found=(22, 1186, 25),
    ),
    _fault(
        "disfc",
        "believes nogoods that contradict its view",
        _DISFC,
        "        if self._coherent(nogood):",
        "        if True:",
        team=(3, 2, 17),
        found=(15, 1112, 3),
    ),
    _fault(
        "compapo",
        "forgets which robots it has asked to wait",
        _COMPAPO,
        "                self.refused.add(robot)\n",
        "",
        team=(3, 2, 33),
        found=(12, 67, 31),
    ),
    _fault(
        "adopt",
        "accepts an outdated value",
        _BOUNDING,
        "if known is None else known[1] < entry[1]",
        "if known is None else known != entry",
        team=(3, 2, 10),
        found=(58, 1485, 1),
    ),
    _fault(
        "adopt",
        "accepts bounds for another context",
        _BOUNDING,
        "        if own is None or not self.agrees(values):",
        "        if own is None:",
        team=(3, 2, 19),
        found=(48, 1446, 20),
    ),
    _fault(
        "adopt",
        "has an upper bound before it knows all values above",
        _BOUNDING,
        "        if len(self._known) == len(self.ancestors):\n            self.upper",
        "        if True:\n            self.upper",
        team=(3, 2, 10),
        found=(39, 1458, 12),
    ),
    _fault(
        "afb",
        "ignores a solution that arrives after the end",
        _AFB,
        "        if self.over:\n            self._adopt_best()\n\n    def _update",
        "\n    def _update",
        team=(3, 2, 0),
        found=(20, 312, 0),
    ),
    _fault(
        "afb",
        "ignores the bound in a CPA",
        _AFB,
        "        self.bound = min(self.bound, cpa.bound)\n        if len",
        "        if len",
        team=(3, 2, 0),
        found=(14, 173, 0),
    ),
    _fault(
        "afb",
        "uses estimates that are for another CPA",
        _AFB_BOUNDS,
        "        known = self.estimates[: common_length(self.stamp, stamp) + 1]",
        "        known = self.estimates[: len(stamp) + 1]",
        team=(3, 2, 54),
        found=(11, 96, 0),
    ),
    _fault(
        "afb",
        "ignores the bound in `Terminate`",
        _AFB,
        "                self.bound = min(self.bound, bound)  # the best solution may arrive later\n",
        "",
        team=(3, 2, 20),
        found=(9, 78, 0),
    ),
)


def main() -> None:
    """Measure the faults."""
    parser = argparse.ArgumentParser(description="Measure the faults in rare orders again, and print their table.")
    parser.add_argument("protocols", nargs="*", metavar="PROTOCOL", help="only faults of this protocol [all]")
    protocols = parser.parse_args().protocols
    for fault in [fault for fault in FAULTS if not protocols or fault.protocol in protocols]:
        found = fault.measured()
        sys.stdout.write(f"{fault.row(found)}\n")
        if found != fault.found:
            sys.stderr.write(f"{fault.name}: {tuple(found)}, before {tuple(fault.found)}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
