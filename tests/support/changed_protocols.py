"""Protocols with one change in their source, and what random runs show of it.

A change is an exact text and its replacement. A source without this text is an error, so that a test of a change that
is no longer possible fails.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import NamedTuple, cast

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.exploration.check import Case
from robochoc.exploration.judgement import TeamJudge
from robochoc.exploration.local_steps import LocalState
from robochoc.model.outcome import Verdict
from robochoc.protocols.protocol import Protocol
from robochoc.run.registry import protocol_named
from tests.support.program import ROOT

LONGEST_RUN_S = 5.0
MOST_MESSAGES = 3000
"""The messages after which a run of a small team counts as endless."""
_IMPORT = re.compile(r"^from (robochoc\.protocols\.\S+) import", re.MULTILINE)


class SourceChange(NamedTuple):
    """A change of a file of robochoc: the text `old`, which occurs once, is replaced by `new`."""

    path: str
    old: str
    new: str

    @property
    def module(self) -> str:
        """The name of the changed module."""
        return self.path.removesuffix(".py").replace("/", ".")

    def applied(self, source: str) -> str:
        """Return the changed source. Raises `ValueError` if the text does not occur exactly once."""
        if (many := source.count(self.old)) != 1:
            raise ValueError(f"{self.path} contains this text {many} times instead of once: {self.old!r}")
        return source.replace(self.old, self.new)


def changed_protocol(name: str, change: SourceChange) -> type[Protocol]:
    """Return the class of the protocol `name` from changed sources. Other protocols are not affected."""
    return protocol_from(name, change.module, change.applied((ROOT / change.path).read_text()))


def protocol_from(name: str, changed: str, text: str) -> type[Protocol]:
    """Return the class of the protocol `name` if the module `changed` has the source `text`."""
    original = protocol_named(name)
    loaded: dict[str, ModuleType] = {}
    with _modules_restored():
        _load(original.__module__, changed, text, loaded)
    if changed not in loaded:
        raise ValueError(f"{name} does not use {changed}")
    return cast("type[Protocol]", getattr(loaded[original.__module__], original.__name__))


def _load(name: str, changed: str, text: str, loaded: dict[str, ModuleType]) -> bool:
    """Load the module `name` again if it imports the changed one, directly or not. Return whether it does."""
    if name in loaded:
        return True
    file = sys.modules[name].__file__
    source = text if name == changed else Path(cast("str", file)).read_text()
    needs = [part for part in _IMPORT.findall(source) if _load(part, changed, text, loaded)]
    if not needs and name != changed:
        return False
    module = loaded[name] = ModuleType(name, sys.modules[name].__doc__)
    module.__file__ = file
    sys.modules[name] = module
    exec(compile(source, f"changed {file}", "exec"), vars(module))  # noqa: S102 - a source of robochoc
    return True


@contextmanager
def _modules_restored() -> Iterator[None]:
    """Put back the modules that are replaced in this context."""
    before = dict(sys.modules)
    try:
        yield
    finally:
        sys.modules.update(before)


def random_faults(case: Case, runs: int) -> int:
    """Return how many of a number of random runs of `case` show a fault, judged as an exploration is."""
    judge = TeamJudge(*case)
    ends = [_random_end(case, seed) for seed in range(runs)]  # the judge knows states by their `id`
    return sum(end is None or bool(judge.on_the_way(end[0], 0) or judge.at_the_end(*end, 0)) for end in ends)


def _random_end(case: Case, seed: int) -> tuple[list[LocalState], int | None] | None:
    """Return the robots and the witness at the end of a run in an order that is drawn from `seed`.

    None: a robot has failed, or the run has no end.
    """
    compiled, phase = case
    simulation = Simulation(compiled, phase.protocol, RandomChannels(seed), parameters=phase.parameters)
    try:
        result = simulation.search(LONGEST_RUN_S, MOST_MESSAGES)
    except Exception:  # noqa: BLE001 - any error of a protocol is a fault
        return None
    if result.verdict is Verdict.UNKNOWN:
        return None
    names = compiled.team.order
    verdicts = {result.witness: result.verdict}
    robots = [LocalState(verdicts.get(name), result.assignments[name], result.findings[name], None) for name in names]
    return robots, None if result.witness is None else names.index(result.witness)
