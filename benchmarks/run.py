"""Measure, and tell: `run.py` measures all short parts and writes RESULTS.md; `run.py PART ...` prints these only.

With --write, their sections in RESULTS.md are written anew. Sections of parts that were not measured stay.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path

import channels
import dynamic
import flagship
import flight
import journals
import local_search
import network
import optimum
import peers
import simulated
import small
import sniffer
import solver
import start
import start_up
import sweep
import transport
import variants
import whole
from measure import RUNS
from report import Section, machine

PARTS: dict[str, Callable[[], Section]] = {
    "whole": whole.measured,
    "peers": peers.measured,
    "startup": start_up.measured,
    "start": start.measured,
    "transport": transport.measured,
    "flagship": flagship.measured,
    "simulator": simulated.measured,
    "journal": journals.measured,
    "solver": solver.measured,
    "small": small.measured,
    "flight": flight.measured,
}
LONG: dict[str, Callable[[], Section]] = {
    "sweep": sweep.measured,
    "variants": variants.measured,
    "dynamic": dynamic.measured,
    "optimum": optimum.measured,
    "local_search": local_search.measured,
    "channels": channels.measured,
    "network": network.measured,
    "sniffer": sniffer.measured,
}
"""Parts that take longer than all others together: only when they are named."""
ALL = {**PARTS, **LONG}
RESULTS = Path(__file__).with_name("RESULTS.md")


def main() -> None:
    """Parse, measure, print or write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"one of: {', '.join(ALL)}")
    parser.add_argument("--write", action="store_true", help="write the parts' sections in RESULTS.md anew")
    options = parser.parse_args()
    chosen: list[str] = options.parts
    if strange := [part for part in chosen if part not in ALL]:
        parser.error(f"no part {strange[0]!r}; there are: {', '.join(ALL)}")
    began = time.monotonic()
    sections = {part: str(_measured(part)) for part in chosen or PARTS}
    if options.write or not chosen:
        kept = _written()
        every = [sections.get(part) or kept.get(part) for part in ALL]
        RESULTS.write_text("\n\n".join([_head(), *filter(None, every)]) + "\n")
        print(f"{RESULTS}: written, after {time.monotonic() - began:.0f} s", file=sys.stderr)
    print("\n\n".join([_head(), *sections.values()]))


def _written() -> dict[str, str]:
    """The sections of RESULTS.md as it is, by part."""
    if not RESULTS.exists():
        return {}
    sections = re.split(r"^(?=## )", RESULTS.read_text(), flags=re.MULTILINE)[1:]
    named = ((re.search(r"^Repeat: `python benchmarks/run.py (\w+)`", text, re.MULTILINE), text) for text in sections)
    return {name[1]: text.strip() for name, text in named if name}


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
