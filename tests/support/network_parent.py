"""A team over the network on this machine, held for ever: `python network_parent.py`. Something happens to it."""

from __future__ import annotations

import argparse
import signal
import sys

from robochoc.communication.network.local import LocalNetwork
from robochoc.communication.search_result import Progress
from robochoc.solver.agent_problem import RunParameters
from tests.support.paused_abt import CHAIN, PausedABT


def main() -> None:
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    parameters = RunParameters(settings={"file": "/nowhere"})
    try:
        with LocalNetwork(CHAIN, PausedABT, parameters=parameters, progress=tell) as network:
            network.search()
    except KeyboardInterrupt:
        sys.exit(128 + signal.SIGINT)


def tell(progress: Progress) -> None:
    if progress.messages:
        sys.stdout.write("searching\n")
        sys.stdout.flush()


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    main()
