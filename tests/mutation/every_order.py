"""Explores master and robots with given protocols, on small teams. Exit status 1: a property does not hold."""

from __future__ import annotations

import argparse
import itertools
import sys

from robochoc.exploration.problems import small_teams
from robochoc.run.registry import protocol_named
from tests.support.explored_searches import concluded, one_search
from tests.support.explored_team import ExploredTeam

ROBOTS = 2


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="Explore master and robots with given protocols.")
    parser.add_argument("protocols", nargs="+", metavar="PROTOCOL", help="a protocol to explore")
    parser.add_argument("--teams", type=int, default=4, help="the number of teams for each protocol [4]")
    parser.add_argument("--states", type=int, default=600, help="the maximum number of states for each team [600]")
    options = parser.parse_args()
    for protocol in map(protocol_named, options.protocols):
        for team in itertools.islice(small_teams(protocol.traits, ROBOTS, 2, 0), options.teams):
            found = ExploredTeam(one_search(team, protocol), concluded, batches=True).explore(options.states)
            if found.fault:
                sys.stdout.write(f"{protocol.__name__}, {team.name}: {found.fault}\n")
                return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
