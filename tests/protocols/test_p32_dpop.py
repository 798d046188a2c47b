"""P3/2-DPOP: each robot has its turn as the root, nobody knows whose it is, and no value is told."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from random import Random
from typing import ClassVar

import pytest

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.journal.events import AnyEvent, Sent
from robochoc.journal.journal import Header, JournalRecorder, read_journal
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.privacy import Kind, Measure, privacy_of
from robochoc.protocols.key_stream import KeyStream
from robochoc.protocols.message import Message
from robochoc.protocols.private.ed25519 import Ed25519
from robochoc.protocols.private.p32_dpop import P32DPOP
from robochoc.protocols.private.rerooting import Join, Next, Setup, Vector, VectorStage
from robochoc.protocols.private.ring import Ring
from robochoc.run import Options, Runtime, solve
from robochoc.solver.agent_problem import RunParameters
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team, random_hard_team, with_costs
from tests.support.examples import count
from tests.support.loose_problems import loosened
from tests.support.pkc_bytes import run
from tests.support.private_problems import RING, own_values, priced, told_values
from tests.support.problems import team_of
from tests.support.pseudo_trees import unplaced
from tests.support.random_options import random_options
from tests.support.toy_group import ToyGroup

SIZE = len(RING.order)


# The optimum


@count("problems", fast=2, slow=300)
def test_the_optimum_is_that_of_dpop(problems: int) -> None:
    """In the group that keeps secrets; `tests/conformance` has many problems in a small one."""
    for number in range(problems):
        chance = Random(f"p32-dpop {number}")
        team = (random_cost_team, random_hard_team)[number % 2](chance)
        team = loosened(team, chance) if number % 3 == 0 else team
        options = replace(random_options(team, "p32-dpop", chance), cache=False)
        private, plain = (solve(team, replace(options, protocol=name)) for name in ("p32-dpop", "dpop"))
        assert (private.verdict, private.cost) == (plain.verdict, plain.cost), (number, options)


# Turns


class Probe(P32DPOP):
    """Notes who was the root in which turn."""

    roots: ClassVar[list[tuple[int, str]]] = []
    group = ToyGroup

    def decide_as_root(self) -> None:
        Probe.roots.append((self.turn, self.problem.agent))
        super().decide_as_root()


def roots(seed: int, spare: int, team: Team = RING) -> list[str]:
    """The root of each turn."""
    Probe.roots.clear()
    parameters = RunParameters(seed, settings={"spare": str(spare)})
    Simulation(team, Probe, RandomChannels(seed), parameters=parameters).run(60)
    assert [turn for turn, _ in Probe.roots] == [*range(len(Probe.roots))]
    return [robot for _, robot in Probe.roots]


def test_each_robot_is_the_root_in_one_turn_and_spare_turns_are_of_one_robot() -> None:
    lengths = set()
    for seed in range(16):
        times = Counter(roots(seed, 3))
        assert times.keys() == {*RING.order}
        assert sorted(times.values())[:-1] == [1] * (SIZE - 1)
        lengths.add(times.total() - SIZE)
    assert lengths == {0, 1, 2, 3}


def test_turns_come_in_every_order() -> None:
    orders = {tuple(roots(seed, 0)) for seed in range(40)}
    assert {order[0] for order in orders} == {*RING.order}
    assert len(orders) > 12  # of 24


def test_a_robot_keeps_its_value_in_the_turns_of_others() -> None:
    # Both pairs of values are optimal: who comes second has to go with the first.
    pair = with_costs(team_of({"A": (1, 2), "B": (1, 2)}, [priced("A", "B", {(1, 1): 5, (2, 2): 5})]))
    for seed in range(6):
        done = solve(pair, Options(protocol="p32-dpop", runtime=Runtime.SIMULATOR, seed=seed, cache=False))
        assert (done.verdict, done.cost) == (Verdict.OPTIMAL, 0)


def test_the_circle_is_the_tree_depth_first() -> None:
    first, middle, leaf = Ring(None, ("B", "C")), Ring("A", ("D",)), Ring("A", ())
    assert (first.onward, middle.onward, leaf.onward) == ("B", "D", "A")
    assert first.on_its_way("B") == "C"  # the next child
    assert first.on_its_way("C") is None  # round
    assert middle.on_its_way("A") is None  # from above: it is for this robot
    assert middle.on_its_way("D") == "A"
    with pytest.raises(ValueError, match="not a neighbour in the tree"):
        leaf.on_its_way("E")


# What is in the messages


def sent(seed: int = 0) -> list[Sent]:
    """All messages of a run with this seed."""
    events: list[AnyEvent] = []
    parameters = RunParameters(seed, settings={"spare": "0"})
    Simulation(RING, P32DPOP, RandomChannels(seed), observer=events.append, parameters=parameters).run(60)
    return [event for event in events if isinstance(event, Sent)]


def test_no_value_is_told_but_as_one_of_the_own_domain() -> None:
    told = sent()
    assert {one.type for one in told} == {
        "Wave", "Token", "Bounce", "Back", "Join", "Setup", "Vector", "Codes", "Table", "Next"
    }  # fmt: skip
    for envelope in run(RING, P32DPOP, 0).envelopes:
        assert not any(name.encode() in envelope.content for name in (*RING.order, *RING.variables))
        if b"Vector" not in envelope.content and b"Table" not in envelope.content:  # random bytes may be anything
            assert told_values(envelope) <= own_values(envelope.sender)


def test_vectors_go_three_times_round_and_that_of_the_first_robot_twice() -> None:
    vectors = [one for one in sent() if one.type == "Vector"]
    assert len(vectors) == 2 * (SIZE - 1) * (3 * (SIZE - 1) + 2)
    assert {len(one.content["ciphers"]) for one in vectors} == {SIZE * 2 * Ed25519.size}


def test_a_vector_that_was_shuffled_cannot_be_told_from_others() -> None:
    size = 2 * Ed25519.size
    seen: dict[bytes, set[bytes]] = {}
    for one in sent():
        if one.type == "Vector" and one.content["stage"] == VectorStage.MIXING:
            ciphers = one.content["ciphers"]
            for at in range(0, len(ciphers), size):
                seen.setdefault(ciphers[at : at + size], set()).add(one.content["tag"])
    assert len(seen) == SIZE * SIZE * SIZE  # each of the vectors, as each robot sends it on
    assert all(len(tags) == 1 for tags in seen.values())


def test_the_measure_of_privacy_finds_no_decision_told() -> None:
    losses = {}
    for protocol in ("p32-dpop", "p-dpop"):
        recorder = JournalRecorder(Header(team=RING.name, protocol=protocol, runtime="simulator", seed=0))
        options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, cache=False)
        recorder.outcome = solve(RING, options, observer=recorder)
        losses[protocol] = privacy_of(read_journal(recorder.content())).system_loss(Kind.DECISION, Measure.ENTROPY)
    assert losses["p32-dpop"] == 0 < (losses["p-dpop"] or 0)


# What cannot be


def robot(name: str = "RB") -> P32DPOP:
    """A robot of a pair that has taken its place in the first tree, under RA."""
    pair = with_costs(team_of({"A": (1, 2), "B": (1, 2)}, [priced("A", "B", {(1, 1): 5})]))
    one = unplaced(P32DPOP, pair, name)
    one.secret = KeyStream(0, name)
    one.join_ring(Ring("RA", ()))
    return one


KEY = Ed25519().one


@looped(("message", "why"), [
    (Setup(bytes(32), 0, 2), "not an element"), (Setup(KEY, 0, 1_000_000), "invalid Setup of 1000000 turns"),
    (Setup(KEY, 0, 1), "1 turns"), (Join(5, KEY + b"x"), "invalid Join"),
    (Join(5, b"\xff" * 32), "not an element"), (Vector(VectorStage.MIXING, bytes(16), bytes(63)), "invalid vector"),
    (Vector(VectorStage.MIXING, bytes(3), b""), "invalid vector"), (Next(), "unexpected Next"),
])  # fmt: skip
def test_a_message_that_cannot_be_is_refused(message: Message, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        robot().receive("RA", message)


def test_a_vector_of_what_are_no_elements_is_refused() -> None:
    one = robot()
    one.receive("RA", Setup(KEY, 0, 2))
    for stage in (VectorStage.MIXING, VectorStage.OPENING):
        with pytest.raises(ValueError, match="not an element"):
            one.receive("RA", Vector(stage, bytes(16), b"\xff" * 128))


def test_a_setup_of_another_robot_is_refused() -> None:
    with pytest.raises(ValueError, match="unexpected Setup"):
        robot().receive("RB", Setup(KEY, 0, 2))
