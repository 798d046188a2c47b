"""P-DPOP: codenames, codes and keys; and what may be read in its messages."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.journal.events import AnyEvent, Sent
from robochoc.journal.journal import Header, JournalRecorder, read_journal
from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.privacy import Kind, Measure, privacy_of
from robochoc.protocols.key_stream import KeyStream, shuffled
from robochoc.protocols.private.anonymous_dfs import Back, Bounce, Token, Wave
from robochoc.protocols.private.p_dpop import BROKEN, KEY_BITS, PDPOP, WIDTH, numbers, packed
from robochoc.replay import CannotReplayError, replay
from robochoc.run import Options, Runtime, solve
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.errors import TooLargeError
from tests.support.cost_problems import with_costs
from tests.support.examples import examples
from tests.support.pkc_bytes import nothing_hidden, run
from tests.support.private_problems import RING, own_values, priced, told_values
from tests.support.problems import team_of

# The optimum


# What is in the messages


@given(seed=st.integers(0, 2**32))
@examples(10)
def test_bodies_hold_no_names_and_values_only_of_the_sender(seed: int) -> None:
    done = run(RING, PDPOP, seed)
    nothing_hidden(PDPOP, done.envelopes)
    for envelope in done.envelopes:
        assert not any(name.encode() in envelope.content for name in (*RING.order, *RING.variables))
        assert told_values(envelope) <= own_values(envelope.sender)


def recorded(team: Team, seed: int = 0) -> list[Sent]:
    """All messages of a run with this seed."""
    events: list[AnyEvent] = []
    Simulation(team, PDPOP, RandomChannels(seed), observer=events.append, parameters=RunParameters(seed)).run(60)
    return [event for event in events if isinstance(event, Sent)]


def test_cells_over_another_robot_s_codename_are_hidden_by_its_key() -> None:
    # In a ring the lowest robot's table is over two codenames, so its parent cannot read one cell of it.
    sent = recorded(RING)
    wide = [numbers(one.content["cells"]) for one in sent if one.type == "UTIL" and len(one.content["axes"]) > 1]
    assert len(wide) == 2
    assert all(cell > BROKEN for cells in wide for cell in cells)


def test_the_same_costs_look_different_under_another_seed() -> None:
    def cells(seed: int) -> set[int]:
        told = [one for one in recorded(RING, seed) if one.type == "UTIL"]
        return {cell for one in told for cell in numbers(one.content["cells"])}

    assert cells(1).isdisjoint(cells(2))


def test_a_broken_constraint_is_a_number_among_keys() -> None:
    assert BROKEN.bit_length() + 20 < KEY_BITS  # 2^20 of them are hidden to 2^-20
    team = team_of({"A": (1, 2), "B": (1, 2), "C": (1, 2)}, [differ("AB"), differ("BC"), differ("AC")])
    cells = [cell for one in recorded(team) if one.type == "UTIL" for cell in numbers(one.content["cells"])]
    assert cells
    assert max(cells) < 1 << 8 * WIDTH - 1


def differ(pair: str) -> Constraint:
    relation = Relation("differ", 2, Semantics.CONFLICTS, ((1, 1), (2, 2)))
    return Constraint("c", relation, (pair[0], pair[1]), (pair[0], pair[1]))


def test_each_neighbour_below_gets_keys_of_its_own_and_the_same_codename() -> None:
    told: dict[str, list[Sent]] = {}
    for one in recorded(RING):
        if one.type == "Codes":
            told.setdefault(one.sender, []).append(one)
    several = [sent for sent in told.values() if len(sent) > 1]
    assert several
    for sent in several:
        assert len({one.content["codename"] for one in sent}) == 1
        assert len({one.content["keys"] for one in sent}) == len(sent)


def test_codes_are_in_another_order_than_values() -> None:
    told = [one for seed in range(12) for one in recorded(RING, seed) if one.type == "Codes"]
    orders = {str(one.content["values"]) for one in told}
    assert len(orders) == 4  # both orders of both domains


def test_the_tree_is_built_without_names_and_degrees() -> None:
    sent = recorded(RING)
    kinds = {kind.__name__ for kind in (Wave, Token, Bounce, Back)}
    assert kinds <= {one.type for one in sent}
    assert all(not one.content for one in sent if one.type in kinds - {"Wave"})
    assert {len(one.content["score"]) for one in sent if one.type == "Wave"} == {16}


# What is lost all the same


def test_a_child_that_shares_constraints_with_its_parent_alone_is_read_as_in_dpop() -> None:
    pair = with_costs(team_of({"A": (1, 2), "B": (1, 2)}, [priced("A", "B", {(1, 1): 2})]))
    losses = []
    for protocol in ("p-dpop", "dpop"):
        recorder = JournalRecorder(Header(team="pair", protocol=protocol, runtime="simulator", seed=0))
        options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, cache=False)
        recorder.outcome = solve(pair, options, observer=recorder)
        losses.append(privacy_of(read_journal(recorder.content())).system_loss(Kind.DOMAIN, Measure.ENTROPY))
    assert losses[0] == losses[1]


# Limits, and what cannot be


def test_a_table_with_too_many_cells_ends_the_run() -> None:
    parameters = RunParameters(settings={"cells": "1"})
    with pytest.raises(TooLargeError, match=r"more than 1 \(--set cells=N"):
        Simulation(RING, PDPOP, RandomChannels(0), parameters=parameters).run(60)


# Keys


def test_keys_follow_from_seed_and_name_and_nothing_else() -> None:
    first, again, other = KeyStream(1, "A"), KeyStream(1, "A"), KeyStream(1, "B")
    drawn = [first(100) for _ in range(50)]
    assert drawn == [again(100) for _ in range(50)]
    assert len({*drawn, *(other(100) for _ in range(50))}) == 100
    assert all(0 <= key < 1 << 100 for key in drawn)
    with pytest.raises(ValueError, match="513 bits"):
        first(513)


def test_every_order_comes_up() -> None:
    stream = KeyStream(3, "A")
    assert len({tuple(shuffled("abc", stream)) for _ in range(200)}) == 6


def test_cells_travel_whole() -> None:
    cells = [0, BROKEN, (1 << 127) - 1]
    assert numbers(packed(cells)) == cells


def test_a_run_across_machines_cannot_be_replayed() -> None:
    recorder = JournalRecorder(Header(team=RING.name, protocol="p-dpop", runtime="simulator", seed=0))
    options = Options(protocol="p-dpop", runtime=Runtime.SIMULATOR, cache=False)
    recorder.outcome = solve(RING, options, observer=recorder)
    journal = read_journal(recorder.content())
    assert replay(journal).identical
    with pytest.raises(CannotReplayError, match="journals do not contain"):
        replay(replace(journal, header=msgspec.structs.replace(journal.header, runtime="network")))
