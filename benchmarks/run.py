"""Benchmarks. Without PART, measure all short parts and write RESULTS.md. With PART, measure these and print them.

Sections of RESULTS.md whose parts are not measured stay as they are. Studies are parts, too: `robochoc experiment`
carries them out, and writes their pages in results/.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path

import app_pages
import array_cluster
import arrays
import auctions
import central_solvers
import choice
import command_time
import crowd
import deadline
import flagship
import flight
import journal_tools
import journals
import messages
import network
import other_flight
import own_studies
import peers
import scale
import simulator
import sniffer
import solver
import start_up
import transport
import warm_starts
import wide_tables
from measure import RUNS
from report import Section, machine

PARTS: dict[str, Callable[[], Section]] = {
    "whole": command_time.measured,
    "startup": start_up.measured,
    "transport": transport.measured,
    "crowd": crowd.measured,
    "flagship": flagship.measured,
    "simulator": simulator.measured,
    "messages": messages.measured,
    "journal": journals.measured,
    "solver": solver.measured,
    "flight": flight.measured,
}
LONG: dict[str, Callable[[], Section]] = {
    "peers": peers.measured,
    "peers_costs": peers.measured_costs,
    "network": network.measured,
    "sniffer": sniffer.measured,
    "journal_tools": journal_tools.measured,
    "app": app_pages.measured,
    "arrays": arrays.measured,
    "auctions": auctions.measured,
    "central": central_solvers.measured,
    "choice": choice.measured,
    "deadline": deadline.measured,
    "wide": wide_tables.measured,
    "starts": warm_starts.measured,
    "growth": scale.measured,
    "cluster": array_cluster.measured,
    "mujoco": other_flight.mujoco,
    "rotorpy": other_flight.rotorpy,
}
"""Parts that take longer than all others together, measured only when they are named."""
ALL = {**PARTS, **LONG}
DECIDED = {
    "start": "how processes are started: by fork",
    "small": "up to which size local problems are enumerated without ACE",
}
"""Measurements that have decided something, and are not repeated. Their sections stay in RESULTS.md."""
RESULTS = Path(__file__).with_name("RESULTS.md")


def main() -> None:
    """Parse, measure, print or write."""
    parser = argparse.ArgumentParser(
        description=__doc__, epilog=_parts(), formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("parts", nargs="*", metavar="PART", help="see below")
    parser.add_argument("--write", action="store_true", help="rewrite the sections of these parts in RESULTS.md")
    options = parser.parse_args()
    chosen: list[str] = options.parts
    if strange := [part for part in chosen if part not in {*ALL, *own_studies.NAMES}]:
        parser.error(f"no part {strange[0]!r}; there are: {', '.join([*ALL, *own_studies.NAMES])}")
    began = time.monotonic()
    sections = {part: str(_measured(part)) for part in chosen or PARTS if part in ALL}
    pages = [own_studies.page_of(name) for name in own_studies.NAMES if name in chosen]
    if options.write or pages or not chosen:
        kept = _written()
        every = [sections.get(part) or kept.get(part) for part in dict.fromkeys((*kept, *ALL))]
        RESULTS.write_text("\n\n".join([_head(), own_studies.listed(), *filter(None, every)]) + "\n")
        print(f"{RESULTS}: written, after {time.monotonic() - began:.0f} s", file=sys.stderr)
    print("\n\n".join([_head(), *sections.values(), *pages]))


def _parts() -> str:
    """Return a line for each part: the first line of its module's docstring."""
    lines = ["parts:"]
    for names, kind in ((PARTS, ""), (LONG, " (takes long)")):
        for name, measured in names.items():
            words = str(sys.modules[measured.__module__].__doc__).splitlines()[0]
            lines.append(f"  {name:12} {words.partition(': ')[2]}{kind}")
    lines += ["studies (a page each, in results/):", *(f"  {name}" for name in own_studies.NAMES)]
    lines += [
        "decided, not measured any more (see RESULTS.md):",
        *(f"  {name:12} {what}" for name, what in DECIDED.items()),
    ]
    return "\n".join(lines)


def _written() -> dict[str, str]:
    """Return the sections of RESULTS.md, in their order: by part, or by title for a part that is gone."""
    if not RESULTS.exists():
        return {}
    sections = re.split(r"^(?=## )", RESULTS.read_text(), flags=re.MULTILINE)[1:]
    found = {}
    for text in sections:
        if text.startswith(own_studies.HEADING):
            continue
        repeated = re.search(r"^Repeat: `python benchmarks/run.py (\w+)`", text, re.MULTILINE)
        found[repeated[1] if repeated else text.partition("\n")[0]] = text.strip()
    return found


def _measured(part: str) -> Section:
    print(f"{part}:", file=sys.stderr)
    return ALL[part]()


def _head() -> str:
    return (
        "# Benchmarks\n\n"
        "Written by `make bench` (`benchmarks/run.py`); the long parts by `benchmarks/run.py --write "
        f"{' '.join(LONG)}`. Machine: {machine()}.\n\n"
        f"Where there is a spread it is of {RUNS} runs, or as many as the table says. Trust ratios and orders of "
        "magnitude: absolute times are of this machine, and of what else it had to do."
    )


if __name__ == "__main__":
    main()
