"""The way of one run of `robochoc solve`: modules entered, functions called, calls back into a package already left.

`python -m tests.support.solve_trace instances/queens3d-4 --runtime simulator --protocol abt` runs the command in this
process and prints the counts; `docs/explanation/way-of-a-run.md` is checked with it.
"""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections import Counter
from functools import cache
from pathlib import Path
from types import FrameType

from tests.support.program import ROOT

_PACKAGE = ROOT / "robochoc"


class SolveTrace:
    """Counts calls of functions of `robochoc`.

    A call back goes into a package that is on the stack further down. A climb is one of these that goes upward, against
    the direction of the imports: a callback. The others use a lower package, while one of its functions calls the rest
    (`system.time_limit.computed_by`).
    """

    def __init__(self) -> None:
        self.calls = Counter[tuple[str, str]]()
        self.crossings = Counter[tuple[str, str]]()
        self.calls_back = Counter[tuple[str, str]]()
        self.climbs = Counter[tuple[str, str]]()
        self._packages: list[str] = []
        self._height = _heights()

    def __call__(self, frame: FrameType, event: str, _: object) -> None:
        """Record a call or a return, as `sys.setprofile` reports it."""
        module = _module(frame.f_code.co_filename)
        if not module:
            return
        if event == "return" and self._packages:
            self._packages.pop()
        if event != "call":
            return
        package = module.partition("/")[0].removesuffix(".py")
        if frame.f_code.co_name != "<module>":
            self.calls[module, frame.f_code.co_qualname] += 1
            if self._packages and self._packages[-1] != package:
                crossing = (self._packages[-1], package)
                self.crossings[crossing] += 1
                if package in self._packages:
                    self.calls_back[crossing] += 1
                    self.climbs[crossing] += self._height.get(package, 0) > self._height.get(crossing[0], 0)
        self._packages.append(package)

    def report(self) -> str:
        """Return the counts, and the climbs by their kind."""
        lines = [
            f"modules entered {len({module for module, _ in self.calls})}",
            f"functions {len(self.calls)}",
            f"calls {self.calls.total()}",
            f"crossings between packages {self.crossings.total()}",
            f"calls back into a package already left {self.calls_back.total()}",
            f"of these, climbs (callbacks into a higher package) {self.climbs.total()}",
            *(f"  {above} -> {below} {count}" for (above, below), count in self.climbs.most_common() if count),
        ]
        return "\n".join(lines)


def _heights() -> dict[str, int]:
    """Return the height of each package among the layers of `pyproject.toml`."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    layers = next(one["layers"] for one in contracts if one["type"] == "layers" and one["containers"] == ["robochoc"])
    return {name: -place for place, layer in enumerate(layers) for name in layer.split(" | ")}


@cache
def _module(filename: str) -> str:
    """Return the path of a module below the package; empty for other code."""
    path = Path(filename)
    return str(path.relative_to(_PACKAGE)) if path.is_relative_to(_PACKAGE) else ""


def main() -> None:
    """Run `robochoc solve` with the arguments of this program, and print the trace."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs=argparse.REMAINDER, help="the arguments of robochoc solve")
    sys.argv = ["robochoc", "solve", *parser.parse_args().words]
    from robochoc.cli.group import run  # noqa: PLC0415 - reads sys.argv

    trace = SolveTrace()
    sys.setprofile(trace)
    try:
        run()
    except SystemExit:
        pass
    finally:
        sys.setprofile(None)
        print(trace.report(), file=sys.stderr)  # noqa: T201 - a tool


if __name__ == "__main__":
    main()
