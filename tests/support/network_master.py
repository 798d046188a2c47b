"""A master in a process of its own: `python network_master.py AUTHORITY ENDPOINT FILE`. See `held.Until` for the file.

It tells of the verdict, or of what went wrong, on standard output; `searching` before that.
"""

from __future__ import annotations

import argparse
import sys

from robochoc.authority.authority import Authority
from robochoc.communication.network.local import LOOPBACK
from robochoc.communication.network.master import Master
from robochoc.communication.network.members import NetworkMembers
from robochoc.communication.search_result import Progress
from robochoc.solver.agent_problem import RunParameters
from tests.support.paused_abt import CHAIN, PausedABT


def main(folder: str, endpoint: str, file: str) -> None:
    def progress(progress: Progress) -> None:
        if progress.messages:
            sys.stdout.write("searching\n")
            sys.stdout.flush()

    authority = Authority.open(folder)
    identity = authority.master_identity([LOOPBACK])
    with Master(authority, identity, endpoint, NetworkMembers(CHAIN.order), progress=progress) as master:
        master.gather()
        result = master.search("held", PausedABT.traits, RunParameters(settings={"file": file}))
        sys.stdout.write(f"{result.verdict}\n")
        master.leave("the run is over")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    for word in ("authority", "endpoint", "file"):
        parser.add_argument(word, metavar=word.upper())
    asked = parser.parse_args()
    main(asked.authority, asked.endpoint, asked.file)
