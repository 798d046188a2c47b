"""Access control as data: what zenoh's rules allow to whom, by a little matcher of key expressions."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from random import Random
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.network.access import ALL, access_control, frame_key, journal_key, life_key, name_in
from robochoc.communication.network.framing import MASTER
from robochoc.communication.network.members import NetworkMembers
from robochoc.communication.network.profile import possible_neighbours
from robochoc.model.problem import Team
from tests.support.cases import looped
from tests.support.problems import random_team
from tests.support.sparse_teams import profiles_of, sparse_team

NAMES = ("R1", "R1.1", "R2", "R21", "r2")
EVERYBODY = (*NAMES, MASTER)
WRITES, READS = ("put", "reply"), ("declare_subscriber", "query")


def includes(wide: str, narrow: str) -> bool:
    """Whether the key expression `wide` has all keys of `narrow`; no wildcard means a chunk that begins with `@`."""

    def within(left: Sequence[str], right: Sequence[str]) -> bool:
        if not left:
            return not right
        if left[0] == "**":
            skip = bool(right) and not right[0].startswith("@") and within(left, right[1:])
            return within(left[1:], right) or skip
        if not right:
            return False
        same = left[0] == right[0] or (left[0] == "*" and right[0] != "**" and not right[0].startswith("@"))
        return same and within(left[1:], right[1:])

    return within(wide.split("/"), narrow.split("/"))


def allows(control: Mapping[str, Any], who: str, flow: str, message: str, key: str) -> bool:
    """Whether `who` may have `message` on `key` pass the router, coming in or going out."""
    subjects = {one["id"] for one in control["subjects"] if who in one["cert_common_names"]}
    rules = {rule["id"]: rule for rule in control["rules"]}
    mine = [rules[i] for policy in control["policies"] if subjects & set(policy["subjects"]) for i in policy["rules"]]
    return any(
        rule["permission"] == "allow"
        and flow in rule["flows"]
        and message in rule["messages"]
        and any(includes(expression, key) for expression in rule["key_exprs"])
        for rule in mine
    )


def passes(control: Mapping[str, Any], sender: str, reader: str, key: str) -> bool:
    """Whether what `sender` puts on `key` reaches `reader`, who has declared to want it."""
    return (
        allows(control, sender, "ingress", "put", key)
        and allows(control, reader, "ingress", "declare_subscriber", key)
        and allows(control, reader, "egress", "put", key)
    )


def keys(names: Sequence[str]) -> Iterator[tuple[str, str, str]]:
    """Keys of frames and of their recovery, with receiver and sender."""
    for receiver, sender in itertools.product(names, repeat=2):
        key = frame_key(receiver, sender)
        for each in (key, f"{key}/@adv/pub/1234/6/_", f"{key}/@adv/sub/1234/6/_"):
            yield receiver, sender, each


def ways(control: Mapping[str, Any], names: Sequence[str]) -> dict[str, set[str]]:
    """To whom each can write."""
    return {
        name: {other for other in names if allows(control, name, "ingress", "put", frame_key(other, name))}
        for name in names
    }


@looped(
    ("wide", "narrow", "expected"),
    [
        ("a/*/c", "a/b/c", True),
        ("a/*/c", "a/*/c", True),
        ("a/b/c", "a/*/c", False),
        ("a/*", "a/b/c", False),
        ("a/**", "a", True),
        ("a/**", "a/b/c", True),
        ("a/*", "a/**", False),
        ("a/*/*", "a/b/@adv", False),
        ("a/**", "a/@adv/b", False),
        ("a/@adv/**", "a/@adv/b/c", True),
        ("rc/msg/R2/*", "rc/msg/R21/R1", False),
    ],
)
def test_the_matcher(wide: str, narrow: str, expected: bool) -> None:  # noqa: FBT001 - a table
    assert includes(wide, narrow) is expected


def test_nobody_writes_in_anothers_name_or_reads_anothers_frames() -> None:
    for reach in ((), (ALL,), NAMES):
        control = access_control(dict.fromkeys(NAMES, reach))
        for who in EVERYBODY:
            for receiver, sender, key in keys(EVERYBODY):
                if sender != who:
                    assert not any(allows(control, who, "ingress", message, key) for message in WRITES)
                if receiver != who:
                    assert not any(allows(control, who, "ingress", message, key) for message in READS)
                    assert not any(allows(control, who, "egress", message, key) for message in WRITES)


@looped("key", ["**", "*/**", "rc/**", "rc/msg/**", "rc/msg/*/*", "rc/live/**", "other"])
def test_nobody_listens_to_everything(key: str) -> None:
    control = access_control(dict.fromkeys(NAMES, (ALL,)))
    for who in EVERYBODY:
        assert not any(allows(control, who, "ingress", message, key) for message in ("put", "declare_subscriber"))


def test_everybody_reads_its_own_frames_and_asks_for_what_it_missed() -> None:
    control = access_control(dict.fromkeys(NAMES, ()))
    for who in EVERYBODY:
        for message in READS:
            assert allows(control, who, "ingress", message, frame_key(who, ALL))
            assert allows(control, who, "ingress", message, f"{frame_key(who, ALL)}/@adv/**")


def test_before_the_team_is_closed_robots_write_to_the_master_only() -> None:
    control = access_control(dict.fromkeys(NAMES, ()))
    assert ways(control, EVERYBODY) == {**{name: {MASTER} for name in NAMES}, MASTER: set(EVERYBODY)}


def test_frames_and_their_recovery_go_where_they_may() -> None:
    reach = {"R1": ("R2",), "R2": ("R1", "R21"), "R21": (), "r2": (ALL,)}
    control = access_control(reach)
    names = [*reach, MASTER]
    for receiver, sender, key in keys(names):
        told = {MASTER: {ALL}}.get(sender) or {MASTER, *reach[sender]}
        assert passes(control, sender, receiver, key) is (ALL in told or receiver in told)


def test_who_is_not_admitted_may_nothing() -> None:
    control = access_control({"R1": ("R2",)})
    assert control["enabled"]
    assert control["default_permission"] == "deny"
    messages = {message for rule in control["rules"] for message in rule["messages"]}
    for _, _, key in keys(("R1", "R2", MASTER)):
        for flow, message in itertools.product(("ingress", "egress"), messages):
            assert not allows(control, "R2", flow, message, key)


def test_everybody_has_one_life_and_sees_all() -> None:
    control = access_control(dict.fromkeys(NAMES, ()))
    for who, other in itertools.product(EVERYBODY, repeat=2):
        assert allows(control, who, "ingress", "liveliness_token", life_key(other)) is (who == other)
        assert allows(control, who, "egress", "liveliness_token", life_key(other))
        assert allows(control, who, "ingress", "declare_liveliness_subscriber", life_key(other))
        assert not any(allows(control, who, "ingress", message, life_key(other)) for message in WRITES)


def test_rules_name_everybody_once() -> None:
    control = access_control(dict.fromkeys(NAMES, ("R1", "R1", MASTER)))
    ids = [rule["id"] for rule in control["rules"]]
    assert len(set(ids)) == len(ids)
    assert [one["cert_common_names"] for one in control["subjects"]] == [[name] for name in EVERYBODY]
    assert all(set(policy["rules"]) <= set(ids) for policy in control["policies"])


def test_names_in_keys() -> None:
    assert name_in(frame_key("R1", "R2.1")) == "R2.1"
    assert name_in(life_key("R2.1")) == "R2.1"
    assert name_in(journal_key("R2.1")) == "R2.1"


@looped("sniffers", [None, (), ("R1",), ("R1", "r2")])
def test_who_may_sniff_asks_in_its_own_name_and_the_master_alone_answers(sniffers: tuple[str, ...] | None) -> None:
    control = access_control(dict.fromkeys(NAMES, (ALL,)), sniffers)
    for who, other in itertools.product(EVERYBODY, repeat=2):
        key = journal_key(other)
        asks = who == other and who in (sniffers or ())
        answers = who == MASTER and sniffers is not None
        assert allows(control, who, "ingress", "query", key) is asks
        assert allows(control, who, "egress", "reply", key) is asks
        assert allows(control, who, "egress", "query", key) is answers
        assert allows(control, who, "ingress", "reply", key) is answers
        assert allows(control, who, "ingress", "declare_queryable", key) is answers
        assert not allows(control, who, "ingress", "put", key)
        assert not allows(control, who, "ingress", "declare_subscriber", key)
    assert not any(allows(control, who, "ingress", "query", journal_key(ALL)) for who in EVERYBODY)


@given(seed=st.integers(0, 2**32), make=st.sampled_from([lambda s: random_team(Random(s)), sparse_team]))
def test_who_stays_within_writes_to_neighbours_and_sharers_only(seed: int, make: Any) -> None:  # noqa: ANN401
    team: Team = make(seed)
    members = NetworkMembers()
    for name, profile in profiles_of(team).items():
        members.register(name, profile, "incarnation")
    met = possible_neighbours(profiles_of(team))
    names = (*team.order, MASTER)
    within = ways(access_control(members.reach(writes_to_non_neighbours=False)), names)
    assert within == {**{name: {MASTER, *met[name]} for name in team.order}, MASTER: set(names)}
    beyond = ways(access_control(members.reach(writes_to_non_neighbours=True)), names)
    assert beyond == {name: set(names) for name in names}


def test_nobody_writes_to_who_is_lost() -> None:
    members = NetworkMembers()
    for name, profile in profiles_of(sparse_team(1)).items():
        members.register(name, profile, "incarnation")
    members.remove(["RX03"])
    reach = members.reach(writes_to_non_neighbours=False)
    assert "RX03" not in reach
    assert all("RX03" not in others for others in reach.values())
