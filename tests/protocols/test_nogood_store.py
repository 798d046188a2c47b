"""The store of nogoods does what one without an index would."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from robochoc.protocols.message import Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.satisfaction.nogood import NO_EXPLANATION, Explanation, LeftSide, NogoodStore, contradicts
from tests.support.cases import looped

ROBOTS = ("A", "B", "C", "D")
SIZE = 6
ORDER = PriorityOrder(ROBOTS)


class Plain:
    """A store that looks at all its nogoods each time."""

    def __init__(self) -> None:
        self.kept: dict[int, tuple[LeftSide, Explanation]] = {}

    def add(self, index: int, lhs: LeftSide, because: Explanation) -> None:
        if index not in self.kept or rating(lhs) < rating(self.kept[index][0]):
            self.kept[index] = lhs, because

    def forget(self, agent: str, value: Value | None) -> None:
        self.keep_if(lambda lhs: agent in lhs and (value is None or contradicts(lhs[agent], value)))

    def forget_others(self, view: dict[str, Value]) -> None:
        self.keep_if(lambda lhs: any(name not in view or contradicts(value, view[name]) for name, value in lhs.items()))

    def keep_if(self, stale: Callable[[LeftSide], bool]) -> None:
        self.kept = {index: one for index, one in self.kept.items() if not stale(one[0])}

    def drop(self, keys: Explanation) -> None:
        self.kept = {index: one for index, one in self.kept.items() if not keys & one[1]}


def rating(lhs: LeftSide) -> tuple[int, int]:
    return max((ROBOTS.index(name) for name in lhs), default=-1), len(lhs)


def any_value(chance: Random) -> Value:
    return chance.choice((None, 0, 1)), chance.choice((None, 0, 1))


@looped("seed", range(40))
def test_the_index_changes_nothing(seed: int) -> None:
    chance = Random(seed)
    store, plain = NogoodStore(ORDER, SIZE), Plain()
    many: list[LeftSide] = [
        {name: any_value(chance) for name in chance.sample(ROBOTS, chance.randrange(4))} for _ in range(8)
    ]
    for _ in range(60):
        agent, value, what = chance.choice(ROBOTS), any_value(chance), chance.random()
        keys = frozenset(chance.sample("xyz", chance.randrange(3)))
        if what < 0.7:
            index, lhs = chance.randrange(SIZE), chance.choice(many)
            store.add(index, lhs, keys)
            plain.add(index, lhs, keys)
        elif what < 0.8:
            told = chance.choice((value, None))
            store.forget(agent, told)
            plain.forget(agent, told)
        elif what < 0.9:
            view = [(any_value(chance), 1) for _ in ROBOTS[: chance.randrange(len(ROBOTS) + 1)]]
            store.forget_others(view, ORDER.rank)
            plain.forget_others({name: value for name, (value, _) in zip(ROBOTS, view, strict=False)})
        else:
            store.drop(keys)
            plain.drop(keys)
        held = [plain.kept.get(index, (None, NO_EXPLANATION)) for index in range(SIZE)]
        assert [store[index] for index in range(SIZE)] == [lhs for lhs, _ in held]
        assert [store.because(index) for index in plain.kept] == [because for _, because in plain.kept.values()]
        left = [index for index in range(SIZE) if index not in plain.kept]
        assert (store.open, store.all_open()) == (len(left), left)
        firsts = [store.first_open(index) for index in range(SIZE)]
        assert firsts == [next((one for one in left if one >= index), None) for index in range(SIZE)]


def test_the_resolvent_has_its_robots_in_the_order_of_the_values() -> None:
    store = NogoodStore(ORDER, 3)
    store.add(2, {"A": (1, None)})
    store.add(0, {"C": (0, 0)})
    store.add(1, {"B": (0, 0), "A": (None, 2)})
    assert list(store.resolve().items()) == [("C", (0, 0)), ("B", (0, 0)), ("A", (1, 2))]
