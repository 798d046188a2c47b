"""Measure the privacy loss of protocols on random meetings, for the tables in docs/guides/privacy.md.

    python benchmarks/privacy.py [PROBLEMS]

First all meetings have to take place (a DisCSP), so that protocols for satisfaction and for costs solve the same
problems; then what meetings are worth is maximised, by complete and by incomplete protocols. The latter need not tell
their last values, so their loss of decisions is not known. P2-DPOP is among the first only: with costs it would compute
for hours. The last table is of auctions, on tasks, one for each robot.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from statistics import mean

from robochoc.generators.meetings import meetings
from robochoc.generators.tasks import tasks
from robochoc.journal.journal import Header, JournalRecorder, read_journal
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.privacy import Kind, Measure, PrivacyReport, privacy_of
from robochoc.run import Options, Runtime, solve

PROBLEMS = 20
SATISFYING = (
    "abt", "abt-hyb", "disfc", "afc", "afc-ng", "compapo", "dpop", "o-dpop", "mb-dpop", "p-dpop", "p32-dpop", "p2-dpop",
    "syncbb", "afb", "sfb", "ncbb", "pt-fb", "hs-cai",
)  # fmt: skip
MINIMISING = (
    "dpop", "o-dpop", "mb-dpop", "p-dpop", "p32-dpop", "syncbb", "syncabb", "afb", "sfb", "ncbb", "pt-fb",
    "hs-cai", "adopt",
)  # fmt: skip
INCOMPLETE = ("dsa", "mgm", "mgm2", "kopt", "cocoa", "d-gibbs", "duct", "maxsum")
ALLOCATING = ("ssi", "cbaa", "cbba", "grape", "dsa", "mgm", "sfb", "dpop")
MAX_VALUE = 10


def planned(seed: int) -> Team:
    """Return meetings that all have to take place."""
    return meetings(6, 6, 2, 4, seed, model="eav")


def valued(seed: int) -> Team:
    """Return meetings whose value is maximised."""
    return meetings(6, 6, 2, 4, seed, max_value=MAX_VALUE, model="eav")


def allocated(seed: int) -> Team:
    """Return tasks, one for each robot."""
    return tasks(5, 5, seed=seed)


TABLES = ((SATISFYING, planned), (MINIMISING, valued), (INCOMPLETE, valued), (ALLOCATING, allocated))


def reports(protocol: str, problems: int, problem: Callable[[int], Team]) -> list[PrivacyReport]:
    """Return the privacy loss in each run that finds a solution."""
    found: list[PrivacyReport] = []
    seed = 0
    while len(found) < problems:
        team = problem(seed)
        recorder = JournalRecorder(Header(team=team.name, protocol=protocol, runtime="simulator", seed=seed))
        options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, seed=seed, cache=False)
        recorder.outcome = solve(team, options, observer=recorder)
        seed += 1
        if recorder.outcome.verdict in {Verdict.SOLUTION, Verdict.OPTIMAL}:
            found.append(privacy_of(read_journal(recorder.content())))
    return found


def row(protocol: str, problems: int, problem: Callable[[int], Team]) -> str:
    """Return a protocol's row of the table."""
    measured = reports(protocol, problems, problem)
    cells = []
    for kind in Kind:
        losses = [loss for one in measured if (loss := one.system_loss(kind, Measure.ENTROPY)) is not None]
        cells.append(f"{mean(losses):.3f}" if len(losses) == len(measured) else "not known")
    return f"| `{protocol}` | {' | '.join(cells)} |"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("problems", nargs="?", type=int, default=PROBLEMS, metavar="PROBLEMS", help="how many")
    problems = parser.parse_args().problems
    for protocols, problem in TABLES:
        print(f"| protocol | {' | '.join(Kind)} |")
        print(f"| --- |{' --- |' * len(Kind)}")
        for protocol in protocols:
            print(row(protocol, problems, problem), flush=True)
        print()


if __name__ == "__main__":
    main()
