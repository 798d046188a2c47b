"""Robots that are built in the parent before the fork, and forgotten."""

from __future__ import annotations

import pytest

from robochoc.communication.host import Host
from robochoc.communication.processes.robot_process import REHEARSED, rehearse
from robochoc.generators.queens3d import queens3d
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.solver.agent_problem import AgentProblem, agent_problems
from robochoc.solver.errors import UnsupportedError


@pytest.fixture
def built(monkeypatch: pytest.MonkeyPatch) -> list[AgentProblem]:
    """Return the parts of which a host is built."""
    found: list[AgentProblem] = []

    def create(protocol: type[Protocol], part: AgentProblem) -> Host:
        found.append(part)
        return true_create(protocol, part)

    true_create = Host.create
    monkeypatch.setattr(Host, "create", create)
    return found


def test_a_few_robots_are_rehearsed(built: list[AgentProblem], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.communication.processes.robot_process.REHEARSAL_S", 1e9)
    parts = list(agent_problems(queens3d(7, "planar")).values())
    rehearse(ABT, parts)
    assert built == parts[:REHEARSED]


def test_it_is_broken_off_when_it_takes_long(built: list[AgentProblem], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.communication.processes.robot_process.REHEARSAL_S", -1.0)
    rehearse(ABT, agent_problems(queens3d(4, "planar")).values())
    assert len(built) == 1


def test_large_domains_are_left_to_the_robots(built: list[AgentProblem], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.communication.processes.robot_process.MIN_TABLE_VALUES", 4)
    rehearse(ABT, agent_problems(queens3d(4, "planar")).values())
    assert built == []


def test_others_protocols_are_left_to_the_robots(built: list[AgentProblem]) -> None:
    class Stubborn(ABT):
        """One that is not ours."""

    rehearse(Stubborn, agent_problems(queens3d(4, "planar")).values())
    assert built == []


def test_what_a_robot_cannot_take_is_left_to_it_to_say(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[AgentProblem] = []

    def refuses(_protocol: type[Protocol], part: AgentProblem) -> Host:
        asked.append(part)
        raise UnsupportedError(part.robot.name)

    monkeypatch.setattr(Host, "create", refuses)
    rehearse(ABT, agent_problems(queens3d(4, "planar")).values())
    assert len(asked) == 1
