"""The forms in which `robochoc directory` prints an answer; the query itself needs a master (tests/network)."""

from __future__ import annotations

import json

import pytest

from robochoc.services.descriptions import AgentDescription, ServiceDescription
from robochoc.services.directory import Directory
from robochoc.services.facilitator import handle
from robochoc.services.sl import DirectoryFunction, df_on, request
from tests.support.program import robochoc_within

DF = df_on("h:7447/robochoc")
AGENT = "RA@h:7447/robochoc"
SERVICES = (ServiceDescription("V1", "variable"), ServiceDescription("/a", "topic"))


def test_an_answer_is_printed_as_a_table_as_json_or_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    directory = Directory()
    agent = AgentDescription(AGENT, SERVICES, protocols=("abt",))
    handle(directory, AGENT, request(DF, DirectoryFunction.REGISTER, agent), 0)
    answers = [
        handle(directory, AGENT, request(DF, DirectoryFunction.SEARCH, AgentDescription(protocols=(name,))), 0)[1]
        for name in ("abt", "sfb")
    ]
    monkeypatch.setattr("robochoc.run.networked.join.identity_of", lambda *_: None)

    def printed(answer: str, *words: str) -> str:
        monkeypatch.setattr("robochoc.run.networked.directory_query.query_directory", lambda *_: answer)
        monkeypatch.setattr("robochoc.run.networked.directory_query.watch_directory", lambda *_: iter(answers))
        done = robochoc_within("directory", "--master", "h:7447", "--as", "Watcher", *words)
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert printed(answers[0], "--sl") == f"{answers[0]}\n"
    assert json.loads(printed(answers[0], "--json"))["name"] == AGENT
    assert printed(answers[0]).split() == ["agent", "protocols", "variables", "topics", AGENT, "abt", "V1", "/a"]
    assert printed(answers[1]) == "no agent matches\n"
    assert printed(answers[1], "--json") == ""
    assert printed(answers[1], "--watch") == f"{AGENT}: variable V1, topic /a\n"
