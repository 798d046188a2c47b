"""One test per rule of Agile-ABT (Bessiere, Bouyakhf, Mechqrane, Wahbi, ICTAI 2011), and properties of its orders."""

from __future__ import annotations

from functools import partial
from random import Random

from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.simulator.schedule import Concurrent, RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.outcome import Verdict
from robochoc.protocols.message import Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.satisfaction.agile_abt import AgileABT
from robochoc.protocols.satisfaction.agile_abt_messages import AddLink, Ok, Order
from robochoc.protocols.satisfaction.agile_order import (
    UNKNOWN,
    Explanation,
    Proposal,
    compatible,
    ordered,
    proposed,
    updated,
)
from robochoc.protocols.satisfaction.nogood_messages import Nogood
from robochoc.protocols.wording import Wording
from tests.support.agents import replies, robot_of, started, started_robot, value
from tests.support.examples import count, examples
from tests.support.problems import random_team
from tests.support.small_teams import different, odd_triple, triangle

agent = partial(started_robot, AgileABT)


def ok(value: int, left: int = 2, size: int = 2, **lhs: int) -> Ok:
    return Ok((value,), {name: (other,) for name, other in lhs.items()}, left, size)


def order(places: str, *termination: int) -> Order:
    """The robots `RA`, `RB`, `RC`, `RD` in the order of `places`."""
    return Order(tuple(["ABCD".index(letter) for letter in places]), termination)


# Orders


def random_explanations(chance: Random) -> tuple[tuple[str, ...], dict[str, Explanation], dict[str, int]]:
    """Robots in an order, explanations that are compatible with it, and the sizes of some domains."""
    names = [f"R{number}" for number in range(chance.randint(2, 9))]
    chance.shuffle(names)
    explanations = {
        name: Explanation({above: (0,) for above in names[:place] if chance.random() < 0.4}, chance.randint(0, 4))
        for place, name in enumerate(names)
        if chance.random() < 0.7
    }
    return tuple(names), explanations, {name: 5 for name in names if chance.random() < 0.8}


chances = st.integers(0, 2**32).map(Random)


@given(chances)
@examples(200)
def test_a_proposed_order_is_compatible_with_all_updated_explanations(chance: Random) -> None:
    names, explanations, sizes = random_explanations(chance)
    conflict = chance.sample(names, chance.randint(1, len(names)))
    culprit = conflict.pop()
    lhs: dict[str, Value] = dict.fromkeys(conflict, (1,))
    result = proposed(names, culprit, lhs, explanations, sizes)
    after = updated(explanations, culprit, lhs, sizes)
    assert sorted(result.names) == sorted(names)
    new = PriorityOrder(result.names)
    assert all(compatible(new, name, one.lhs) for name, one in after.items())
    assert compatible(new, culprit, lhs)
    left = [after[name].left if name in after else sizes.get(name, UNKNOWN) for name in result.names]
    assert result.termination == tuple(left)


@given(chances)
@examples(200)
def test_of_the_robots_that_may_come_next_the_one_with_the_fewest_values_left_does(chance: Random) -> None:
    names, explanations, _ = random_explanations(chance)
    left = {name: chance.randint(0, 3) for name in names}
    result = ordered(names, explanations, left)
    for place, name in enumerate(result):
        free = [
            other
            for other in result[place:]
            if other not in explanations or set(explanations[other].lhs) <= set(result[:place])
        ]
        assert name == min(free, key=lambda other: (left[other], names.index(other)))


def test_update_explanations_forgets_what_rests_on_the_culprit_and_takes_one_value_from_it() -> None:
    before = {"B": Explanation({"A": (1,)}, 2), "C": Explanation({"B": (1,)}, 1), "D": Explanation({"A": (1,)}, 3)}
    after = {"B": Explanation({"A": (1,), "E": (4,)}, 1), "D": Explanation({"A": (1,)}, 3)}
    assert updated(before, "B", {"E": (4,)}, {}) == after
    for sizes, left in (({"A": 4}, 3), ({"A": 0}, 0), ({}, UNKNOWN)):
        assert updated({}, "A", {}, sizes) == {"A": Explanation({}, left)}, "it counts its whole domain"


class Watched(AgileABT):
    """Notes whatever order it takes that is not stronger, and whatever it keeps that an order does not go with."""

    faults: list[str]
    last: dict[str, tuple[str, ...]]

    def _check_order(self, names: tuple[str, ...], termination: tuple[int, ...]) -> None:
        before = self.termination, self.present.names
        super()._check_order(names, termination)
        after = self.termination, self.present.names
        if after > before or sorted(names) != sorted(self.order.names) or (before != after != (termination, names)):
            self.faults.append(f"{before} became {after}")
        self.last[self.name] = self.present.names

    def settle(self) -> None:
        super().settle()
        if not all(compatible(self.present, self.name, lhs) for lhs in self.store):
            self.faults.append(f"{list(self.store)} in {self.present.names}")

    def _proposed(self, *dead_end: object) -> Proposal:
        proposal = super()._proposed(*dead_end)  # type: ignore[arg-type]
        if sorted(proposal.names) != sorted(self.order.names):
            self.faults.append(f"{proposal} is circular")
        return proposal


@count("teams", 80, 300)
def test_orders_only_become_stronger_and_all_robots_end_with_the_same(teams: int) -> None:
    chance = Random("orders")
    reordered = 0
    for _ in range(teams):
        Watched.faults, Watched.last = [], {}
        team = random_team(chance)
        seed = chance.getrandbits(32)
        result = Simulation(team, Watched, chance.choice((RandomChannels(seed), Concurrent(seed, 20)))).run(10)
        assert not Watched.faults
        if result.verdict is Verdict.SOLUTION and Watched.last:
            reordered += 1
            assert len(Watched.last) == len(team.robots)
            assert len(set(Watched.last.values())) == 1
    assert reordered > teams // 8


# Values


def test_start_takes_the_first_value_and_tells_it_with_its_explanation_to_those_below() -> None:
    assert started(robot_of(AgileABT, triangle(), "RB")) == [("RC", ok(1))]


def test_a_value_that_those_above_allow_is_kept_and_those_below_are_not_heeded() -> None:
    """An `Ok` says on whom the nogoods rest, and how many values are left."""
    assert replies(agent(triangle(3), "RB"), ("RA", ok(1, 3, 3))) == [("RC", ok(2, 2, 3, RA=1))]
    for other in (("RA", ok(2)), ("RC", ok(1))):
        agile = agent(triangle(), "RB")
        assert replies(agile, other) == []
        assert value(agile) == (1,)


def test_the_lowest_robot_at_present_checks_an_n_ary_constraint() -> None:
    agile = agent(odd_triple(), "RA", ("RB", ok(1)), ("RC", ok(1)))
    assert agile.problem.checks == 0
    replies(agile, ("RB", Order((1, 2, 0), (1, 1, 1))))
    assert value(agile) == (2,)
    assert list(agile.store) == [{"RB": (1,), "RC": (1,)}]


# Orders that arrive


def test_process_order_adopts_a_smaller_termination_vector_only() -> None:
    agile = agent(triangle(), "RA", ("RD", order("DCBA", 1, 2, 1, 2)))
    assert agile.present.names == ("RD", "RC", "RB", "RA")
    replies(agile, ("RC", order("CDBA", 1, 2, 2, 1)))
    assert agile.present.names == ("RD", "RC", "RB", "RA")
    replies(agile, ("RC", order("CDBA", 1, 1, 9, 9)))
    assert agile.present.names == ("RC", "RD", "RB", "RA")
    equal = [("RD", order("BDCA", 1, 1, 1, 1)), ("RC", order("BCDA", 1, 1, 1, 1))]
    for packet in (equal, equal[::-1]):
        assert agent(triangle(), "RA", *packet).present.names == ("RB", "RC", "RD", "RA"), "the first by its names"


def test_an_order_of_robots_that_the_reader_does_not_know_is_told_by_their_places() -> None:
    known = Wording("RA", "RB", ("RA", "RB", "RC", "RD"))
    assert order("DBAC", 1).in_words(known) == "the order is now RD, RB, RA and RC"
    assert order("DBAC", 1).in_words(known._replace(order=known.order[:3])) == (
        "the order is now, by the places of the first one, 4, 2, 1 and 3"
    )
    assert Order((-1, 0), (1,)).in_words(known) == "the order is now, by the places of the first one, 0 and 1"


def test_an_order_tells_the_value_to_those_that_are_below_now_and_have_not_heard_it() -> None:
    down, up, down_again = order("BACD", 1, 1, 1, 1), order("ABCD", 0, 1, 1, 1), order("BACD", 0, 0, 1, 1)
    agile = agent(triangle(3), "RB")
    assert [replies(agile, ("RA", one)) for one in (down, up, down_again)] == [[("RA", ok(1, 3, 3))], [], []]
    agile = agent(triangle(3), "RB", ("RA", down), ("RA", ok(1, 3, 3)))
    assert replies(agile, ("RA", up)) == [("RC", ok(2, 2, 3, RA=1))]
    assert replies(agile, ("RA", down_again)) == [("RA", ok(2, 3, 3))]


def test_an_order_drops_nogoods_that_rest_on_robots_that_are_not_above() -> None:
    agile = agent(triangle(3), "RB", ("RA", ok(1, 3, 3)))
    replies(agile, ("RC", Nogood({}, (2,))))
    assert list(agile.store) == [{"RA": (1,)}, {}]
    replies(agile, ("RD", order("DBAC", 1, 1, 1, 1)))
    assert list(agile.store) == [{}]


# Dead ends


def test_a_dead_end_tells_all_a_smaller_order_before_it_sends_the_nogood() -> None:
    agile = agent(triangle(), "RC")
    said = replies(agile, ("RA", ok(1)), ("RB", ok(2, left=1)))
    smaller = order("BACD", 1, 1, 1, UNKNOWN)
    assert said[:3] == [("RA", smaller), ("RB", smaller), ("RD", smaller)]
    assert said[3:] == [("RA", Nogood({"RB": (2,)}, (1,)))]
    assert agile.present.names == ("RB", "RA", "RC", "RD")
    assert agile.explanations == {"RA": Explanation({"RB": (2,)}, 1), "RB": Explanation({}, 1)}
    assert "RA" not in agile.view


def test_of_all_robots_in_the_conflict_the_one_with_the_smallest_vector_is_blamed() -> None:
    """A robot whose explanation falls has its whole domain left."""
    for size, smaller, blamed in (
        # RB's explanation keeps it below RA, whose blame would set it free: (2, 1, 1, ..) against (2, 0, 1, ..).
        (2, order("ABCD", 2, 0, 1, UNKNOWN), ("RB", Nogood({"RA": (1,)}, (2,)))),
        (3, order("BCAD", 2, 1, 2, UNKNOWN), ("RA", Nogood({"RB": (2,)}, (1,)))),
    ):
        said = replies(agent(triangle(), "RC"), ("RA", ok(1, size, size)), ("RB", ok(2, 1, RA=1)))
        assert (said[0], said[3]) == (("RA", smaller), blamed)


def test_without_a_smaller_vector_the_lowest_robot_is_blamed_in_the_present_order() -> None:
    agile = agent(triangle(), "RC", ("RD", order("BACD", 1, 1, 1, 1)))
    assert replies(agile, ("RA", ok(1)), ("RB", ok(2, left=1))) == [("RA", Nogood({"RB": (2,)}, (1,)))]
    assert "RA" not in agile.view


def test_explanations_count_while_order_view_and_own_value_go_with_them() -> None:
    below_a = Explanation({"RA": (1,)}, 1)
    agile = agent(triangle(3), "RC", ("RA", ok(1, 3, 3)), ("RB", ok(2, 1, 3, RA=1)))
    assert agile._held_explanations()["RB"] == below_a  # noqa: SLF001 - what a dead end would look at
    for name, packet in {
        "order": ("RD", order("BACD", 1, 1, 1, 1)),
        "view": ("RA", ok(2, 3, 3)),
    }.items():
        agile = agent(triangle(3), "RC", ("RA", ok(1, 3, 3)), ("RB", ok(2, 1, 3, RA=1)), packet)
        assert "RB" not in agile._held_explanations(), name  # noqa: SLF001
    agile = agent(triangle(3), "RC", ("RD", ok(2, 1, 3, RC=1)))
    assert agile._held_explanations() == {}  # noqa: SLF001


def test_an_empty_nogood_ends_the_search_without_solution_and_nothing_is_said_after_it() -> None:
    agile = agent(triangle(1), "RA")
    assert replies(agile, ("RB", Nogood({}, (1,)))) == []
    assert agile.verdict is Verdict.NO_SOLUTION
    assert replies(agile, ("RB", AddLink()), ("RB", order("BACD", 1, 1, 1, 1))) == []


def test_a_value_that_is_taken_again_is_not_told_again() -> None:
    agile = agent(triangle(), "RC", ("RA", ok(1)), ("RB", ok(2, left=1)))
    assert value(agile) == (1,)  # it has forgotten RA; RD was told at the start
    assert replies(agile, ("RB", ok(1))) == [("RD", ok(2, 1, RB=1))]


# Nogoods that arrive


def test_resolve_conflict_accepts_a_coherent_nogood_and_takes_another_value() -> None:
    agile = agent(triangle(3), "RB", ("RA", ok(2, 3, 3)))
    assert replies(agile, ("RC", Nogood({"RA": (2,)}, (1,)))) == [("RC", ok(3, 1, 3, RA=2))]


def test_resolve_conflict_answers_an_obsolete_nogood_about_the_value_it_has_told_and_not_about_one_replaced() -> None:
    agile = agent(triangle(), "RB", ("RA", ok(2)))
    assert replies(agile, ("RC", Nogood({"RA": (1,)}, (1,)))) == [("RC", ok(1))]
    agile = agent(triangle(), "RB", ("RA", ok(1)))
    assert replies(agile, ("RC", Nogood({}, (1,)))) == []
    assert value(agile) == (2,)
    assert list(agile.store) == [{"RA": (1,)}]


def test_a_nogood_that_rests_on_robots_below_is_obsolete_and_its_sender_is_told_once_it_is_below() -> None:
    agile = agent(triangle(), "RB", ("RA", ok(2)), ("RD", order("BACD", 1, 1, 1, 1)))
    assert replies(agile, ("RC", Nogood({"RA": (2,)}, (1,)))) == [("RC", ok(1))]
    assert list(agile.store) == []
    agile = agent(triangle(), "RB", ("RD", order("CBAD", 2, 2, 2, 2)))
    assert replies(agile, ("RC", Nogood({"RA": (1,)}, (1,)))) == []
    assert replies(agile, ("RD", order("BCAD", 1, 2, 2, 2))) == [("RC", ok(1))]


# Links


def test_check_add_link_asks_unknown_robots_of_the_left_side_and_believes_it() -> None:
    agile = agent(different("ABC", "AC BC", 2), "RB")
    assert replies(agile, ("RC", Nogood({"RA": (1,)}, (1,)))) == [("RA", AddLink()), ("RC", ok(2, 1, RA=1))]
    assert agile.view == {"RA": (1,)}
    assert replies(agile, ("RC", Nogood({"RA": (2,)}, (2,)))) == [("RC", ok(2, 1, RA=1))]


def test_set_link_tells_the_value_to_the_new_listener_now_and_later_once_it_is_below() -> None:
    agile = agent(triangle(), "RA")
    assert replies(agile, ("RD", AddLink())) == [("RD", ok(1))]
    assert replies(agile, ("RD", AddLink())) == [("RD", ok(1))]
    assert replies(agile, ("RB", Nogood({}, (1,)))) == [(name, ok(2, 1)) for name in ("RB", "RC", "RD")]
    agile = agent(triangle(), "RB", ("RD", order("ADBC", 2, 2, 2, 2)))
    assert replies(agile, ("RD", AddLink())) == []
    assert replies(agile, ("RC", order("ABCD", 1, 2, 2, 2))) == [("RD", ok(1))]
