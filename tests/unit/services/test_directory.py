"""The Directory Facilitator: who may register what, who finds whom, leases, subscriptions, bounds."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from robochoc.services import descriptions, directory
from robochoc.services.descriptions import AgentDescription, Reason, RequestRefusedError, ServiceDescription, matches
from robochoc.services.directory import Directory, Notice
from tests.support.cases import cases

LASER = ServiceDescription("eyes", "laser", "Ann", ("abt", "afc"), ("o",), ("sl",), (("range", "30"), ("unit", "m")))
ROBOT = AgentDescription("r1", (LASER, ServiceDescription("arm", "grip")), ("abt",), ("o1", "o2"), ("fipa-sl0",))
ANYBODY = AgentDescription()


Act = Callable[[], object]


def described(name: str, lease_s: float | None = None, *protocols: str) -> AgentDescription:
    return AgentDescription(name, protocols=protocols, lease_s=lease_s)


def names(found: tuple[AgentDescription, ...]) -> list[str]:
    return [one.name for one in found]


TEMPLATES: list[tuple[AgentDescription, bool]] = [
    (ANYBODY, True),
    (ROBOT, True),
    (AgentDescription("r1"), True),
    (AgentDescription("R1"), False),
    (AgentDescription(protocols=("abt",)), True),
    (AgentDescription(protocols=("abt", "afc")), False),
    (AgentDescription(ontologies=("o2",)), True),
    (AgentDescription(languages=("sl",)), False),
    (AgentDescription(addresses=("tcp/a:1",)), False),
    (AgentDescription(lease_s=5), True),
    (AgentDescription(services=(ServiceDescription(type="laser"),)), True),
    (AgentDescription(services=(ServiceDescription(type="laser"), ServiceDescription(name="arm"))), True),
    (AgentDescription(services=(ServiceDescription("arm", "laser"),)), False),
    (AgentDescription(services=(ServiceDescription(ownership="Bob"),)), False),
    (AgentDescription(services=(ServiceDescription(protocols=("afc",)),)), True),
    (AgentDescription(services=(ServiceDescription(languages=("kif",)),)), False),
    (AgentDescription(services=(ServiceDescription(properties=(("unit", "m"),)),)), True),
    (AgentDescription(services=(ServiceDescription(properties=(("unit", "30"),)),)), False),
]


def test_all_that_a_template_gives_must_match() -> None:
    with cases() as each:
        for template, found in TEMPLATES:
            with each(template):
                assert matches(template, ROBOT) is found
                there = Directory()
                there.register(ROBOT, 0, requester="r1")
                assert there.search(template, 0) == ((ROBOT,) if found else ())


def test_a_search_is_by_name_and_may_be_limited() -> None:
    there = Directory()
    for robot in ("r2", "r3", "r1"):
        there.register(described(robot), 0, requester=robot)
    assert names(there.search(ANYBODY, 0)) == ["r1", "r2", "r3"]
    assert names(there.search(ANYBODY, 0, 2)) == ["r1", "r2"]
    assert there.search(ANYBODY, 0, 0) == ()
    assert names(there.search(AgentDescription("r2"), 0, -1)) == ["r2"]


def test_everybody_speaks_for_himself_only() -> None:
    there = Directory()
    there.register(described("r1"), 0, requester="r1")
    acts: tuple[Act, ...] = (
        lambda: there.register(described("r2"), 0, requester="r1"),
        lambda: there.modify(described("r1", None, "afc"), 0, requester="r2"),
        lambda: there.renew("r1", 0, requester="r2"),
        lambda: there.deregister("r1", requester="r2"),
    )
    for forbidden in acts:
        with pytest.raises(RequestRefusedError) as caught:
            forbidden()
        assert caught.value.reason is Reason.UNAUTHORISED
    assert there.search(ANYBODY, 0) == (described("r1"),)


def test_registered_once_known_or_not() -> None:
    there = Directory()
    acts: tuple[Act, ...] = (
        lambda: there.modify(described("r1"), 0, requester="r1"),
        lambda: there.renew("r1", 0, requester="r1"),
        lambda: there.deregister("r1", requester="r1"),
        lambda: there.unsubscribe("r1"),
    )
    for unknown in acts:
        with pytest.raises(RequestRefusedError, match=r"^not-registered$"):
            unknown()
    there.register(described("r1"), 0, requester="r1")
    with pytest.raises(RequestRefusedError, match=r"^already-registered$"):
        there.register(described("r1"), 0, requester="r1")
    there.deregister("r1", requester="r1")
    there.register(described("r1"), 0, requester="r1")


def test_a_lease_ends_unless_it_is_renewed_or_modified() -> None:
    there = Directory()
    for robot in ("gone", "renewed", "modified", "stays"):
        there.register(described(robot, None if robot == "stays" else 10), 0, requester=robot)
    there.renew("renewed", 9, requester="renewed")
    there.modify(described("modified", 5), 9, requester="modified")
    assert there.expire(9.9) == ()
    assert names(there.search(ANYBODY, 10)) == ["modified", "renewed", "stays"]
    assert there.expire(10) == ("gone",)
    assert there.expire(10) == ()
    with pytest.raises(RequestRefusedError, match="not-registered"):
        there.renew("modified", 14, requester="modified")
    assert there.expire(19) == ("modified", "renewed")
    assert names(there.search(ANYBODY, 1e9)) == ["stays"]


def test_who_comes_back_has_not_expired() -> None:
    there = Directory()
    there.register(described("r1", 1), 0, requester="r1")
    there.register(described("r1", 1), 2, requester="r1")
    assert there.expire(2) == ()


def test_subscribers_are_told_what_is_there_and_what_changes() -> None:
    there = Directory()
    there.register(described("r1", None, "abt"), 0, requester="r1")
    there.subscribe("watch", AgentDescription(protocols=("abt",)), 0)
    assert there.notices() == (Notice("watch", "r1", described("r1", None, "abt")),)
    assert there.notices() == ()
    there.register(described("r2", None, "afc"), 0, requester="r2")
    assert there.notices() == ()
    there.modify(described("r2", None, "afc", "abt"), 0, requester="r2")
    there.modify(described("r1", None, "afc"), 0, requester="r1")
    there.register(described("r3", 5, "abt"), 0, requester="r3")
    assert there.notices() == (
        Notice("watch", "r2", described("r2", None, "afc", "abt")),
        Notice("watch", "r1", None),
        Notice("watch", "r3", described("r3", 5, "abt")),
    )
    there.deregister("r2", requester="r2")
    there.deregister("r1", requester="r1")
    there.expire(5)
    assert there.notices() == (Notice("watch", "r2", None), Notice("watch", "r3", None))


def test_only_the_newest_of_an_agent_is_told() -> None:
    there = Directory()
    there.subscribe("watch", ANYBODY, 0)
    there.register(described("r1"), 0, requester="r1")
    there.register(described("r2"), 0, requester="r2")
    there.modify(described("r1", None, "abt"), 0, requester="r1")
    assert there.notices() == (
        Notice("watch", "r2", described("r2")),
        Notice("watch", "r1", described("r1", None, "abt")),
    )


def test_several_templates_of_one_subscriber_are_one_view() -> None:
    there = Directory()
    for protocol in ("abt", "afc"):
        there.subscribe("watch", AgentDescription(protocols=(protocol,)), 0)
    there.register(described("r1", None, "abt"), 0, requester="r1")
    there.notices()
    there.modify(described("r1", None, "afc"), 0, requester="r1")
    assert there.notices() == (Notice("watch", "r1", described("r1", None, "afc")),)
    there.unsubscribe("watch", AgentDescription(protocols=("afc",)))
    there.modify(described("r1", None, "afc", "dpop"), 0, requester="r1")
    assert there.notices() == ()
    there.modify(described("r1", None, "abt"), 0, requester="r1")
    there.unsubscribe("watch")
    assert there.notices() == ()
    with pytest.raises(RequestRefusedError, match="not-registered"):
        there.unsubscribe("watch", ANYBODY)


LONG = "x" * (descriptions.MAX_CHARACTERS + 1)
LARGE = tuple((f"{number:03}" + "x" * 500, "x" * 500) for number in range(66))
MANY = tuple(map(str, range(descriptions.MAX_NAMES + 1)))


REFUSED: list[tuple[AgentDescription, str]] = [
    (AgentDescription(), "missing-parameter df-agent-description name"),
    (AgentDescription("r", (ServiceDescription(type="t"),)), "missing-parameter service-description name"),
    (AgentDescription("r", (ServiceDescription("n"),)), "missing-parameter service-description type"),
    (AgentDescription("r", (LASER,) * 65), "df-agent-description services"),
    (AgentDescription("r", protocols=MANY), "df-agent-description protocols"),
    (AgentDescription("r", ontologies=(LONG,)), "df-agent-description ontologies"),
    (AgentDescription("r", addresses=MANY), "df-agent-description addresses"),
    (AgentDescription(LONG), "df-agent-description name"),
    (AgentDescription("r", (ServiceDescription(LONG, "t"),)), "service-description name"),
    (AgentDescription("r", (ServiceDescription("n", "t", languages=MANY),)), "service-description languages"),
    (AgentDescription("r", (ServiceDescription("n", "t", properties=(("a", LONG),)),)), "properties"),
    (AgentDescription("r", (ServiceDescription("n", "t", properties=(("a", "b"),) * 1025),)), "properties"),
    (AgentDescription("r", (ServiceDescription("n", "t", properties=LARGE),)), "internal-error .* too large"),
    *((AgentDescription("r", lease_s=lease_s), "lease-time") for lease_s in (0, -1, math.inf, math.nan, 1e9)),
]


def test_what_is_incomplete_or_too_large_is_refused() -> None:
    with cases() as each:
        for description, about in REFUSED:
            with each(about):
                there = Directory()
                with pytest.raises(RequestRefusedError, match=about) as caught:
                    there.register(description, 0, requester=description.name)
                assert len(str(caught.value)) < 100
                assert not len(there)


def test_templates_are_bounded_too() -> None:
    for ask in (Directory().search, lambda template, now: Directory().subscribe("w", template, now)):
        with pytest.raises(RequestRefusedError, match="unrecognised-parameter-value"):
            ask(AgentDescription(protocols=MANY), 0)


def test_the_directory_fills_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(directory, "MAX_REGISTRATIONS", 2)
    monkeypatch.setattr(directory, "MAX_SUBSCRIPTIONS", 2)
    there = Directory()
    for robot in ("r1", "r2"):
        there.register(described(robot, 5), 0, requester=robot)
        there.subscribe(robot, ANYBODY, 0)
    with pytest.raises(RequestRefusedError, match=r"internal-error .* full"):
        there.register(described("r3"), 0, requester="r3")
    with pytest.raises(RequestRefusedError, match=r"internal-error .* full"):
        there.subscribe("r3", ANYBODY, 0)
    there.subscribe("r1", ANYBODY, 0)
    there.register(described("r3"), 5, requester="r3")


class Watched(RuleBasedStateMachine):
    """A subscriber who follows the notices always knows what a search would find."""

    TEMPLATE = AgentDescription(protocols=("abt",))
    ROBOTS = st.sampled_from(("r1", "r2", "r3"))
    PROTOCOLS = st.lists(st.sampled_from(("abt", "afc")), max_size=2, unique=True)
    LEASES = st.none() | st.integers(1, 5)

    @initialize()
    def begin(self) -> None:
        self.there = Directory()
        self.now = 0
        self.view: dict[str, AgentDescription] = {}
        self.truth: dict[str, tuple[AgentDescription, float]] = {}
        self.there.subscribe("watch", self.TEMPLATE, 0)

    @rule(robot=ROBOTS, protocols=PROTOCOLS, lease_s=LEASES)
    def tell(self, robot: str, protocols: list[str], lease_s: int | None) -> None:
        description = described(robot, lease_s, *protocols)
        act = self.there.modify if robot in self.truth else self.there.register
        act(description, self.now, requester=robot)
        self.truth[robot] = description, math.inf if lease_s is None else self.now + lease_s

    @rule(robot=ROBOTS)
    def renew(self, robot: str) -> None:
        if robot in self.truth:
            self.there.renew(robot, self.now, requester=robot)
            lease_s = self.truth[robot][0].lease_s
            self.truth[robot] = self.truth[robot][0], math.inf if lease_s is None else self.now + lease_s

    @rule(robot=ROBOTS)
    def leave(self, robot: str) -> None:
        if robot in self.truth:
            self.there.deregister(robot, requester=robot)
            del self.truth[robot]

    @rule(seconds=st.integers(1, 4))
    def wait(self, seconds: int) -> None:
        self.now += seconds
        ended = {robot for robot, (_, end) in self.truth.items() if end <= self.now}
        assert set(self.there.expire(self.now)) == ended
        for robot in ended:
            del self.truth[robot]

    @invariant()
    def the_view_is_the_truth(self) -> None:
        for notice in self.there.notices():
            if notice.description is None:
                del self.view[notice.name]
            else:
                self.view[notice.name] = notice.description
        expected = {robot: told for robot, (told, _) in self.truth.items() if "abt" in told.protocols}
        assert {one.name: one for one in self.there.search(self.TEMPLATE, self.now)} == expected
        assert self.view == expected


TestWatched = Watched.TestCase


@given(
    st.lists(st.sampled_from(("abt", "afc", "dpop")), max_size=3), st.lists(st.sampled_from(("abt", "afc")), max_size=2)
)
def test_sets_match_by_inclusion(offered: list[str], asked: list[str]) -> None:
    there = matches(AgentDescription(protocols=tuple(asked)), AgentDescription("r", protocols=tuple(offered)))
    assert there is (set(asked) <= set(offered))
