"""Measure, and tell: `run.py` measures everything and writes RESULTS.md; `run.py PART ...` prints these parts only."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import flagship
import peers
import simulated
import solver
import start
import transport
import whole
from measure import RUNS
from report import Section, machine

PARTS: dict[str, Callable[[], Section]] = {
    "whole": whole.measured,
    "peers": peers.measured,
    "start": start.measured,
    "transport": transport.measured,
    "flagship": flagship.measured,
    "simulator": simulated.measured,
    "solver": solver.measured,
}
RESULTS = Path(__file__).with_name("RESULTS.md")


def main() -> None:
    """Parse, measure, print or write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"one of: {', '.join(PARTS)}")
    chosen: list[str] = parser.parse_args().parts
    if strange := [part for part in chosen if part not in PARTS]:
        parser.error(f"no part {strange[0]!r}; there are: {', '.join(PARTS)}")
    began = time.monotonic()
    sections = [_measured(part) for part in chosen or PARTS]
    text = "\n\n".join([_head(), *map(str, sections)]) + "\n"
    if not chosen:
        RESULTS.write_text(text)
        print(f"{RESULTS}: written, after {time.monotonic() - began:.0f} s", file=sys.stderr)
    print(text)


def _measured(part: str) -> Section:
    print(f"{part}:", file=sys.stderr)
    return PARTS[part]()


def _head() -> str:
    return (
        "# Benchmarks\n\n"
        f"Written by `make bench` (`benchmarks/run.py`). Machine: {machine()}.\n\n"
        f"Where there is a spread it is of {RUNS} runs, or as many as the table says. Trust ratios and orders of "
        "magnitude: absolute times are of this machine, and of what else it had to do."
    )


if __name__ == "__main__":
    main()
