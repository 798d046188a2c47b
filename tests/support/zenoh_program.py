"""A program that runs one team across a network of this machine, in processes, and across a network again.

It prints the verdicts, and `closed` as its last act: from then on nothing may keep it from ending. A file of its own,
as the robots' fork server imports the program that it belongs to.
"""

from __future__ import annotations

import argparse
import sys

from robochoc.communication.network.local import LocalNetwork
from robochoc.communication.processes.processes import ProcessesRun
from robochoc.generators.random_csp import random_csp
from robochoc.protocols.satisfaction.abt import ABT


def say(what: str) -> None:
    """Tell the test."""
    sys.stdout.write(f"{what}\n")
    sys.stdout.flush()


def main() -> None:
    """Run, thrice."""
    team = random_csp(4, 3, 1.0, 0.3, 1, connected=True)
    for runtime in (LocalNetwork, ProcessesRun, LocalNetwork):
        with runtime(team, ABT) as session:
            say(str(session.search(60).verdict))
    say("closed")


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    main()
