"""Teams with symbolic domains: the sniffer shows names, in decisions and in messages' words."""

from __future__ import annotations

import json

from robochoc.formats import PREDEFINED
from robochoc.journal.journal import Header, read_journal
from robochoc.journal.recorder import JournalRecorder
from robochoc.model.assembly import assemble
from robochoc.model.problem import Constraint, Domain, Variable
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.sniffer.page_data import PageData
from robochoc.sniffer.trace import Trace

COLOURS = Domain("colours", (range(2),), ("red", "green"))


def test_decisions_and_words_have_the_names_of_symbols() -> None:
    scope = ("x", "y")
    team = assemble(
        "colours",
        {"a": [Variable("x", COLOURS)], "b": [Variable("y", COLOURS)]},
        [Constraint("C", PREDEFINED["ne"], scope, scope)],
    )
    recorder = JournalRecorder(Header(team=team.name, protocol="abt", runtime="simulator", seed=0))
    recorder.outcome = solve(team, Options(protocol="abt", runtime=Runtime.SIMULATOR), observer=recorder)
    data = PageData(Trace.of(read_journal(recorder.content())))
    decided = [values for _, values in json.loads(data.decisions(0, len(data.trace.decisions)))]
    assert {"x": "red"} in decided
    assert {"y": "green"} in decided
    assert b"x = red" in data.details(0)
