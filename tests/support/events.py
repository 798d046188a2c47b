"""Strategies: any entry that a journal may hold."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from robochoc.journal import events
from robochoc.journal.events import AnyEvent
from robochoc.journal.journal import Header
from robochoc.model.outcome import EpochOutcome, Metrics, Outcome, PseudoTreeNode, Verdict

names = st.sampled_from(["Robot1.1", "Robot1.2", "Robot2.1", "R", "Ω"]) | st.text(max_size=8)
numbers = st.integers(-(2**62), 2**62)
counts = st.integers(0, 2**40) | numbers
times = st.integers(0, 2**40).map(float) | st.floats(-1e12, 1e12) | st.floats(0, 100)
scalars = (
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats(allow_nan=False) | st.text(max_size=8)
)
fields: st.SearchStrategy[Any] = st.recursive(
    scalars, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(names, inner, max_size=3), max_leaves=5
)
assignments = st.dictionaries(names, numbers, max_size=3)
costs = st.integers(0, 2**60) | st.floats(0, 1e9)
told_costs = st.integers(-(10**9), 10**9) | st.decimals(-(10**9), 10**9, places=3)
contents = st.sampled_from([("value",), ("lhs", "value"), ()]).flatmap(
    lambda keys: st.fixed_dictionaries(dict.fromkeys(keys, fields))
)


def _of(kind: type[Any], **parts: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    return st.builds(kind, t=times, **parts)


any_event: st.SearchStrategy[AnyEvent] = st.one_of(
    _of(events.Began, protocol=names),
    _of(events.Began, protocol=names, epoch=counts, opened_by=names, minimises=st.booleans()),
    _of(
        events.Given,
        order=st.lists(names, max_size=3).map(tuple),
        robots=st.dictionaries(names, st.text(max_size=20), max_size=2),
        aside=st.none() | st.floats(0, 1e9),
        settings=st.dictionaries(names, names, max_size=2),
        quiet=st.booleans(),
        why=names,
    ),
    _of(events.Registered, robot=names),
    _of(events.DroppedOut, robot=names, why=names),
    _of(events.Sent, sender=names, receiver=names, type=names, content=contents, bytes=counts, clock=counts),
    _of(events.Received, sender=names, receiver=names, type=names, clock=counts),
    _of(events.Decided, robot=names, assignment=assignments, clock=counts),
    _of(
        events.Heard,
        robot=names,
        cost=costs,
        values=st.dictionaries(names, st.lists(st.none() | numbers, max_size=3).map(tuple), max_size=3),
    ),
    _of(events.Improved, cost=told_costs, assignment=assignments),
    _of(events.Settled, robot=names, clock=counts, checks=counts),
    _of(events.Concluded, robot=names, verdict=names),
    _of(events.Lost, robot=names, why=names),
    _of(events.Leads, master=names, term=st.integers(1, 9), why=names),
    _of(events.Granted, who=names, what=names, origin=names),
    _of(events.Refused, who=names, what=names, why=names, origin=names),
)
headers = st.builds(
    Header,
    team=names,
    protocol=names,
    runtime=st.just("simulator"),
    seed=counts,
    order=names | st.lists(names, max_size=2).map(tuple),
    channel=names,
)
outcomes = st.builds(
    Outcome,
    team=names,
    protocol=names,
    runtime=names,
    seed=counts,
    verdict=st.sampled_from(Verdict),
    assignment=assignments,
    cost=st.none() | told_costs,
    metrics=st.builds(Metrics, messages=assignments, bytes=counts, wall_s=st.floats(0, 1e9)),
    tree=st.dictionaries(names, st.builds(PseudoTreeNode, st.none() | names), max_size=2),
    epochs=st.lists(st.builds(EpochOutcome, st.sampled_from(Verdict), robots=st.just(("R",))), max_size=2).map(tuple),
)
