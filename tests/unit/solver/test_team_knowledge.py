"""What robots know of each other: one object for all, sent without what can be made anew."""

from __future__ import annotations

import pickle

from robochoc.communication.control import pack_change, unpack_change
from robochoc.communication.host import Host
from robochoc.generators.coloring import coloring
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.solver.agent_problem import AgentProblem, RunParameters, agent_problems
from robochoc.solver.explanation import Invalidated
from robochoc.solver.local_problem import LocalProblem


def parts(robots: int) -> list[AgentProblem]:
    return list(agent_problems(coloring(robots, 3, 3, conflicts="hard"), RunParameters(settings={})).values())


def test_all_robots_of_a_process_look_into_the_same() -> None:
    first, *others = parts(20)
    hosts = [Host.create(ABT, part) for part in others]
    assert all(part.known is first.known for part in others)
    assert all(host.protocol.order.rank is first.known.rank for host in hosts)
    assert all(host.protocol.order.names is first.known.order for host in hosts)


def test_ranks_and_owners_are_those_of_the_team() -> None:
    team = coloring(20, 3, 3)
    known = parts(20)[0].known
    assert [known.order[known.rank[name]] for name in team.order] == list(team.order)
    assert dict(known.owners) == {
        v.name: robot.name for robot in team.robots for v in robot.variables if v.name in known.domains
    }


def test_what_one_robot_is_sent_grows_with_the_team_and_no_faster() -> None:
    small, large = (max(len(pickle.dumps(part)) for part in parts(robots)) for robots in (200, 400))
    assert large < 2.5 * small


def test_ranks_and_owners_are_not_sent() -> None:
    part = parts(400)[7]
    known = part.known
    whole = len(pickle.dumps((known.order, known.interfaces, dict(known.domains), known.links)))
    assert len(pickle.dumps(known)) < whole + 200


def test_it_is_the_same_after_it_was_sent() -> None:
    part = parts(20)[7]
    nothing = Invalidated(frozenset(), frozenset())
    sent, _ = unpack_change(pack_change(part, nothing))
    assert sent == part
    assert sent.known.rank == part.known.rank
    assert sent.known.owners == part.known.owners
    assert LocalProblem(sent).neighbours == LocalProblem(part).neighbours
