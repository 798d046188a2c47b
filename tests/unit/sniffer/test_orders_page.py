"""The page on which one chooses the next message: its data are the state graph, and begin with the counterexample."""

from __future__ import annotations

import itertools
import json
import re
from dataclasses import replace
from typing import Any

from robochoc.exploration.changes import FaultPlan
from robochoc.exploration.check import CheckedTeam, CheckOptions, checked, graph_of
from robochoc.exploration.problems import small_teams
from robochoc.model.problem import Team
from robochoc.protocols.local_search.dsa import DSA
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.dynabt import DynABT
from robochoc.protocols.satisfaction.nogood_messages import Nogood
from robochoc.run import Options, Runtime
from robochoc.sniffer.orders_page import orders_page
from tests.support.compiled import plain_python_only
from tests.support.faulty_abt import NoAnswer

pytestmark = plain_python_only


class BadNogood(ABT):
    """Refuses each nogood."""

    def _resolve_conflict(self, sender: str, nogood: Nogood) -> None:
        raise ValueError(f"{sender} sends {nogood}")


class BadStart(ABT):
    """Fails at its start."""

    def start(self) -> None:
        raise ValueError("at the start")


def small_team(number: int, protocol: type[Protocol] = ABT) -> Team:
    return next(itertools.islice(small_teams(protocol.traits, 3, 2, 0), number, None))


def page_of(
    team: Team, protocol: type[Protocol] = ABT, *, most: int = 10_000, **options: Any  # noqa: ANN401 - of `CheckOptions`
) -> tuple[dict[str, Any], CheckedTeam, CheckOptions]:  # fmt: skip
    """Return the data on a page, and its check."""
    name = {DSA: "dsa", DynABT: "dynabt"}.get(protocol, "abt")
    settings = {"cycles": "2"} if protocol is DSA else {}
    run = Options(protocol=name, runtime=Runtime.SIMULATOR, settings=settings)
    check = CheckOptions(protocol, run, **options)
    (found,) = checked([team], check)
    page = orders_page(found, check, most).decode()
    (data,) = re.findall(r'<script id="data" type="application/json">(.*?)</script>', page, re.DOTALL)
    return json.loads(data), found, check


def states_along(data: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the states on the path of the page."""
    states = [data["states"][0]]
    for step in data["path"]:
        states.append(data["states"][states[-1]["steps"][step]["after"]])
    return states


def test_the_page_has_all_states_and_steps_of_the_team() -> None:
    data, found, check = page_of(small_team(2))
    graph = graph_of(found.case, check)
    first = graph.start().state
    states, waiting = {first}, [first]
    while waiting:
        after = {move.state for move in graph.moves(waiting.pop())} - states
        states |= after
        waiting += after
    assert data["complete"]
    assert len(data["states"]) == len(states) > found.exploration.states
    assert {state["answer"] for state in data["states"] if not state["steps"]} == {"no-solution"}
    assert {state["fault"] for state in data["states"]} == {""}
    assert data["path"] == []


def test_the_path_leads_to_the_fault_and_its_messages_are_those_of_the_report() -> None:
    data, found, _ = page_of(small_team(56), NoAnswer)
    *before, last = states_along(data)
    assert len(before) == len(found.exploration.path) == 4
    assert last["fault"] == found.exploration.fault
    assert not any(state["fault"] or state["answer"] for state in before)
    assert data["fault"] == found.exploration.explanation.text
    assert "as long as V1 = 0, V2 cannot be 0" in data["messages"]
    robot = data["robots"][before[-1]["robots"][1]]
    assert robot["view"] == []
    assert robot["value"] == "V2 = 0"


def test_a_refused_message_is_the_last_step() -> None:
    data, found, _ = page_of(small_team(56), BadNogood)
    last = states_along(data)[-1]
    assert last["fault"] == found.exploration.fault
    assert "cannot be used" in found.exploration.fault
    assert last["steps"] == []


def test_states_beyond_the_limit_are_left_out_but_not_those_of_the_path() -> None:
    data, found, _ = page_of(small_team(56), NoAnswer, most=2)
    assert not data["complete"]
    assert len(data["states"]) == len(found.exploration.path) + 1
    assert any(step["after"] == -1 for state in data["states"] for step in state["steps"])
    assert states_along(data)[-1]["fault"]


def test_lost_messages_and_packets_are_steps_too() -> None:
    data, *_ = page_of(small_team(1, DSA), DSA, losses=1, packets=True, most=200)
    steps = [step for state in data["states"] for step in state["steps"]]
    assert {step["lost"] for step in steps} == {False, True}
    assert "The robots continue without the messages that they lack" in {step["text"] for step in steps}


def test_crashes_and_events_are_steps_and_later_states_have_the_remaining_robots() -> None:
    data, *_ = page_of(small_team(0, DynABT), DynABT, plan=FaultPlan(crashes=1), most=300)
    texts = {step["text"] for state in data["states"] for step in state["steps"]}
    assert any("the problem changes" in text for text in texts)
    assert {len(state["robots"]) for state in data["states"]} == {2, 3}


def test_a_page_without_a_start_shows_the_fault_and_names_remain_text() -> None:
    team = replace(small_team(0), name="</script><b>")
    data, found, _ = page_of(team, BadStart)
    assert data["states"] == data["path"] == []
    assert data["fault"].startswith("Robot1 has failed: ValueError: at the start.")
    assert data["title"] == f"abt on {found.team.name}"
