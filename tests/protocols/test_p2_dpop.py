"""P2-DPOP: tables that nobody reads, one value for each robot, and nothing else that is told."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from random import Random
from typing import Any, ClassVar

import msgspec
import pytest

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.generators.meetings import meetings
from robochoc.journal.events import AnyEvent, Decided, Sent
from robochoc.journal.journal import Header, JournalRecorder, read_journal
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.privacy import Kind, Measure, privacy_of
from robochoc.protocols import traits
from robochoc.protocols.private.elgamal import TeamKey
from robochoc.protocols.private.linear_order import CostSum
from robochoc.protocols.private.p2_dpop import P2DPOP
from robochoc.run import Options, Runtime, solve
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.errors import TooLargeError, UnsupportedError
from tests.support.cases import looped
from tests.support.cost_problems import random_complex_cost_team, random_cost_team, random_hard_team, with_costs
from tests.support.encrypted_problems import affordable
from tests.support.examples import count
from tests.support.loose_problems import loosened, minimum_cost
from tests.support.pkc_bytes import nothing_hidden, run
from tests.support.problems import team_of
from tests.support.random_options import random_options
from tests.support.toy_group import ToyGroup

Rows = dict[tuple[int, int], float]
NEAR: Rows = {(711, 811): 2, (711, 812): 1, (712, 811): 0, (712, 812): 3}
OTHER: Rows = {(711, 811): 0, (711, 812): 3, (712, 811): 1, (712, 812): 0}
"""As dear at most, but with another optimum."""
VALUES = {"AAA": (711, 712), "BBB": (811, 812), "CCC": (711, 712), "DDD": (811, 812)}


def soft(scope: tuple[str, ...], rows: Mapping[Any, float]) -> Constraint:
    relation = Relation("R", len(scope), Semantics.SOFT, tuple(rows), tuple(rows.values()))
    return Constraint("c", relation, scope, scope)


def ring(rows: Rows = NEAR, forbidden: int | None = None) -> Team:
    """Four robots in a ring; AAA may be forbidden a value."""
    pairs = [("AAA", "BBB"), ("CCC", "BBB"), ("CCC", "DDD"), ("AAA", "DDD")]
    constraints = [soft(pair, rows) for pair in pairs]
    if forbidden is not None:
        constraints.append(soft(("AAA",), {(forbidden,): INFINITE}))
    return with_costs(team_of(VALUES, constraints))


RING = ring()
SIZE = len(RING.order)


# The optimum


@count("problems", fast=2, slow=100)
def test_the_optimum_is_that_of_brute_force(problems: int) -> None:
    """In the group that keeps secrets; `tests/conformance` has many problems in a small one."""
    makers = (random_cost_team, random_hard_team, random_cost_team, random_complex_cost_team)
    for number in range(problems):
        chance = Random(f"p2-dpop {number}")
        team = affordable("p2-dpop", partial(makers[number % 4], chance))
        team = loosened(team, chance) if number % 3 == 0 else team
        options = replace(random_options(team, "p2-dpop", chance), cache=False, settings={"ciphers": "1000000"})
        outcome, least = solve(team, options), minimum_cost(team)
        if least == INFINITE:
            assert outcome.verdict is Verdict.NO_SOLUTION, (number, options)
        else:
            assert outcome.verdict in {Verdict.OPTIMAL, Verdict.SOLUTION}, (number, options)
            assert (outcome.cost or 0) == least, (number, options)


@pytest.mark.usefixtures("quick_encryption")
@looped("max_value", [None, 4])
def test_meetings_get_the_worth_that_dpop_finds(max_value: int | None) -> None:
    for seed in range(2):
        team = meetings(5, 5, 2, 4, seed, max_value=max_value, model="eav")  # worth is a negative cost
        options = Options(runtime=Runtime.SIMULATOR, cache=False, seed=seed)
        outcome = solve(team, replace(options, protocol="p2-dpop", settings={"ciphers": "100000"}))
        plain = solve(team, replace(options, protocol="dpop"))
        assert (outcome.verdict, outcome.cost) == (plain.verdict, plain.cost)


@pytest.mark.usefixtures("quick_encryption")
def test_parts_that_nothing_connects_and_robots_alone() -> None:
    domains = dict.fromkeys("ABCDEF", (1, 2))
    parts = [soft(("A", "B"), {(1, 1): 2}), soft(("C", "D"), {(1, 1): 1, (2, 2): 1, (1, 2): 1, (2, 1): 1})]
    alone = [soft(("E",), {(1,): 3, (2,): 2}), soft(("F",), {(1,): INFINITE, (2,): 1})]
    outcome = solve(with_costs(team_of(domains, [*parts, *alone])), options_of("p2-dpop"))
    assert (outcome.verdict, outcome.cost) == (Verdict.OPTIMAL, 4)
    outcome = solve(
        with_costs(team_of(domains, [soft(("E",), {(1,): INFINITE, (2,): INFINITE})])), options_of("p2-dpop")
    )
    assert outcome.verdict is Verdict.NO_SOLUTION


def options_of(protocol: str, **settings: str) -> Options:
    return Options(protocol=protocol, runtime=Runtime.SIMULATOR, cache=False, settings=settings)


@pytest.mark.usefixtures("quick_encryption")
def test_a_robot_keeps_its_value_in_the_turns_of_others() -> None:
    # Two pairs of values are optimal: who comes second has to go with the first.
    pair = with_costs(team_of({"A": (1, 2), "B": (1, 2)}, [soft(("A", "B"), {(1, 1): 3, (2, 2): 3})]))
    for seed in range(8):
        done = solve(pair, replace(options_of("p2-dpop"), seed=seed))
        assert (done.verdict, done.cost) == (Verdict.OPTIMAL, 0)


# Turns


class Probe(P2DPOP):
    """Notes who took its value in which turn, and what was opened."""

    group = ToyGroup
    roots: ClassVar[list[tuple[int, str]]] = []

    def _choose(self, place: int) -> None:
        Probe.roots.append((self.turn, self.problem.agent))
        super()._choose(place)


def test_each_robot_is_the_root_in_one_turn_and_spare_turns_are_of_one_robot() -> None:
    lengths = set()
    for seed in range(16):
        Probe.roots.clear()
        parameters = RunParameters(seed, settings={"spare": "3"})
        Simulation(RING, Probe, RandomChannels(seed), parameters=parameters).run(60)
        assert [turn for turn, _ in Probe.roots] == [*range(len(Probe.roots))]
        times = Counter(robot for _, robot in Probe.roots)
        assert times.keys() == {*RING.order}
        assert sorted(times.values())[:-1] == [1] * (SIZE - 1)
        lengths.add(times.total() - SIZE)
    assert lengths == {0, 1, 2, 3}


def test_turns_come_in_every_order() -> None:
    orders = set()
    for seed in range(30):
        Probe.roots.clear()
        Simulation(RING, Probe, RandomChannels(seed), parameters=RunParameters(seed, settings={"spare": "0"})).run(60)
        orders.add(tuple(robot for _, robot in Probe.roots))
    assert {order[0] for order in orders} == {*RING.order}
    assert len(orders) > 12  # of 24


# What is in the messages

CIPHERS = {"ciphers", "cipher"}


def told(team: Team, seed: int = 0, protocol: type[P2DPOP] = Probe) -> list[tuple[str, str, str, Any]]:
    """All messages of a run: sender, receiver, type and content, but for ciphers, of which only the length is."""
    found = []
    for one in sent(team, seed, protocol):
        plain = {key: len(part) if key in CIPHERS else part for key, part in one.content.items()}
        found.append((one.sender, one.receiver, one.type, plain))
    return found


def sent(team: Team, seed: int = 0, protocol: type[P2DPOP] = Probe) -> list[Sent]:
    """All messages of a run with this seed."""
    events: list[AnyEvent] = []
    parameters = RunParameters(seed, settings={"spare": "0"})
    Simulation(team, protocol, RandomChannels(seed), observer=events.append, parameters=parameters).run(60)
    return [event for event in events if isinstance(event, Sent)]


def values_of(team: Team, seed: int) -> dict[str, int]:
    """The values that the robots take."""
    taken: dict[str, int] = {}

    def note(event: AnyEvent) -> None:
        if isinstance(event, Decided):
            taken.update(event.assignment)

    Simulation(team, Probe, RandomChannels(seed), observer=note, parameters=RunParameters(seed)).run(60)
    return taken


def test_other_costs_change_nothing_that_is_told_but_ciphers() -> None:
    assert values_of(RING, 0) != values_of(ring(OTHER), 0)
    for seed in range(6):
        assert told(RING, seed) == told(ring(OTHER), seed)


def test_a_value_that_a_robot_cannot_take_changes_nothing_that_is_told_but_ciphers() -> None:
    for seed in range(6):
        plain = told(RING, seed)
        assert plain == told(ring(forbidden=711), seed)
        assert plain == told(ring(forbidden=712), seed)


def test_dearer_costs_are_seen_in_the_sum_of_all_only() -> None:
    dearer = ring({**NEAR, (712, 812): 4})
    ranges = {tuple(content.values()) for _, _, kind, content in told(dearer) if kind == "CostRange"}
    assert ranges == {(0, 16)}
    assert {tuple(content.values()) for _, _, kind, content in told(RING) if kind == "CostRange"} == {(0, 12)}


def test_sums_begin_with_random_numbers() -> None:
    sums = [tuple(one.content.values()) for seed in range(4) for one in sent(RING, seed) if one.type == "CostSum"]
    assert len({*sums}) >= 4 * SIZE
    assert min(min(pair) for pair in sums) > 1 << 40


def test_private_costs_are_counted_from_their_least() -> None:
    alone = [soft(("AAA",), {(711,): 5, (712,): 6}), soft(("BBB",), {(811,): 7, (812,): INFINITE})]
    team = with_costs(team_of(VALUES, [*RING.constraints(), *alone]))
    ranges = {tuple(content.values()) for _, _, kind, content in told(team) if kind == "CostRange"}
    assert ranges == {(12, 13)}


def test_bodies_hold_no_names_and_values_only_as_declared() -> None:
    done = run(RING, Probe, 0)
    nothing_hidden(Probe, done.envelopes)
    for envelope in done.envelopes:
        assert not any(name.encode() in envelope.content for name in (*RING.order, *RING.variables))
    for sender, _, kind, content in told(RING):
        if kind == "Axis":
            assert sorted(content["values"]) == [(value,) for value in VALUES[sender[1:]]]
        else:
            assert not {711, 712, 811, 812} & {part for part in content.values() if isinstance(part, int)}


def test_codenames_and_orders_of_values_are_new_in_each_turn() -> None:
    names: dict[str, set[tuple[int, str]]] = defaultdict(set)
    orders = set()
    for seed in range(4):
        for sender, _, kind, content in told(RING, seed):
            if kind == "Axis":
                names[f"{sender} {seed}"].add((content["turn"], content["codename"]))
                orders.add(str(content["values"]))
    for pairs in names.values():
        assert len({turn for turn, _ in pairs}) == len({name for _, name in pairs}) == len(pairs)
    assert len(orders) == 4


def test_no_cipher_comes_twice() -> None:
    """Also none that the root has opened: the robot before it has made those of the last table."""
    pair = with_costs(team_of({"A": (1, 2), "B": (1, 2), "C": (1, 2)}, [soft(("A", "B"), {(1, 1): 1})] * 2))
    size = P2DPOP.group.size
    told = sent(pair, 0, P2DPOP)
    tables = {one.content["ciphers"] for one in told if one.type == "EncryptedTable"}
    opened = {one.content["cipher"] for one in told if one.type == "Opening"}
    halves = [group[at : at + size] for group in (*tables, *opened) for at in range(0, len(group), size)]
    assert len(tables) == 2 * 2  # two robots are linked, and each has a turn
    assert opened
    assert len({*halves}) == len(halves)


def test_as_many_ciphers_are_opened_whatever_is_in_them() -> None:
    numbers = set()
    for rows in (NEAR, OTHER, dict.fromkeys(NEAR, 3.0)):
        kinds = Counter(one.type for one in sent(ring(rows)))
        numbers.add(kinds["Opening"])
    levels = 4 * 3 + 1
    assert numbers == {SIZE * (levels.bit_length() + 1) * 2 * (SIZE - 1)}  # a bit for the value; all round the tree


def test_what_is_opened_is_a_bit_and_no_number(monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[int] = []
    plain = TeamKey.is_zero

    def is_zero(key: TeamKey, stripped: bytes) -> bool:
        read.append(int.from_bytes(key.pairs(stripped)[0][1], "little"))
        return plain(key, stripped)

    sent(RING)
    monkeypatch.setattr(TeamKey, "is_zero", is_zero)
    sent(RING)
    opened = read[SIZE * SIZE :]  # before that, whose turn it is: without blinding, 0 or 1
    assert 0 in opened
    assert len({*opened}) > len(opened) // 3
    assert min(number for number in opened if number) > 1 << 30


def test_the_measure_of_privacy_finds_nothing_told() -> None:
    losses: dict[str, list[float | None]] = {}
    for protocol in ("p2-dpop", "p32-dpop"):
        recorder = JournalRecorder(Header(team=RING.name, protocol=protocol, runtime="simulator", seed=0))
        recorder.outcome = solve(RING, options_of(protocol), observer=recorder)
        report = privacy_of(read_journal(recorder.content()))
        losses[protocol] = [report.system_loss(kind, Measure.ENTROPY) for kind in Kind]
    assert not any(losses["p2-dpop"])
    assert None not in losses["p2-dpop"]
    assert any(losses["p32-dpop"])


# Limits


def test_what_needs_too_many_ciphers_is_refused_before_any_table_is_made() -> None:
    events: list[AnyEvent] = []
    parameters = RunParameters(settings={"ciphers": "51"})
    says = r"needs a table of 52 ciphers \(832 bytes\), more than 51: .* 4 cells over 2 robots, and costs from 0 to 12"
    with pytest.raises(TooLargeError, match=says + r" \(--set ciphers=N raises the limit\)"):
        Simulation(RING, Probe, RandomChannels(0), observer=events.append, parameters=parameters).run(60)
    kinds = {event.type for event in events if isinstance(event, Sent)}
    assert "Plan" in kinds
    assert "EncryptedTable" not in kinds
    parameters = RunParameters(settings={"ciphers": "52"})
    result = Simulation(RING, Probe, RandomChannels(0), parameters=parameters).run(60)
    assert result.verdict is Verdict.SOLUTION


@pytest.mark.usefixtures("quick_encryption")
def test_a_refusal_names_other_protocols_and_no_other_refusal_names_this_one() -> None:
    with pytest.raises(
        UnsupportedError, match=r"these do: \w+, p-dpop, p32-dpop \(--protocol\), and \d+ more: 'robochoc protocols'"
    ):
        solve(RING, options_of("p2-dpop", ciphers="5"))
    with pytest.raises(UnsupportedError, match="these do: ") as refused:
        solve(RING, options_of("abt"))
    assert "p2-dpop" not in str(refused.value)


@looped("protocol", ["p2-dpop", "p32-dpop"])
def test_without_the_extra_a_run_is_refused_and_told_what_to_install(
    protocol: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(traits, "find_spec", lambda _: None)
    with pytest.raises(UnsupportedError, match=rf"{protocol} needs nacl.*pip install 'robochoc\[private\]'"):
        solve(RING, options_of(protocol))


def test_messages_are_plain_data() -> None:
    assert msgspec.structs.asdict(CostSum(1, 2)) == {"least": 1, "range": 2}
