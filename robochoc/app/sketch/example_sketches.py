"""The example sketches in the gallery. Their texts are in `texts/en/examples.toml`."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import msgspec

from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Setting, Sketch, SketchRobot, SketchRule
from robochoc.app.texts import say


def examples() -> dict[str, Sketch]:
    """Return the example sketches with their stories by key, in the order of the gallery: those with a flight first.

    For the title of an example see `title_of`, for its topic `shows`.
    """
    return {key: example(key) for key in _MADE}


def example(key: str) -> Sketch:
    """Return an example. Raises `KeyError` for an unknown key."""
    return msgspec.structs.replace(_MADE[key](), name=key, story=say(f"example.{key}.story"))


def title_of(key: str) -> str:
    """Return the title of an example."""
    return say(f"example.{key}.title")


def shows(key: str) -> str:
    """Return the topic of an example, in a few words."""
    return say(f"example.{key}.shows")


class _RuleList:
    """A growing list of numbered rules."""

    def __init__(self) -> None:
        self.all: tuple[SketchRule, ...] = ()

    def add(
        self,
        kind: str,
        decision: str,
        *robots: str,
        cost: int | None = None,
        private: bool = False,
        **settings: Setting,
    ) -> _RuleList:
        """Add a rule, and return this object for chained calls."""
        made = SketchRule(f"R{len(self.all) + 1}", kind, decision, robots, settings, cost, private)
        self.all = (*self.all, made)
        return self


def _robots(**places: tuple[int, int]) -> tuple[SketchRobot, ...]:
    return tuple(SketchRobot(name, Cell(*place)) for name, place in places.items())


def _numbers(area: Area, *cells: tuple[int, int]) -> tuple[int, ...]:
    return tuple(area.number(Cell(*cell)) for cell in cells)


def _charging() -> Sketch:
    area = Area(8, 5)
    robots = _robots(Ada=(1, 3), Ben=(3, 4), Cleo=(4, 2), Dan=(6, 3), Eve=(2, 1))
    slot = Decision("slot", DecisionKind.SLOT, (1, 2, 3, 4, 5))
    rules = _RuleList().add("different", "slot")
    for name, wish, cost in (("Ada", 1, 4), ("Ben", 1, 3), ("Cleo", 2, 5), ("Dan", 2, 2), ("Eve", 5, 3)):
        rules.add("rather", "slot", name, value=wish, step=cost)
    return Sketch(area=area, robots=robots, decisions=(slot,), rules=rules.all)


def _cube() -> Sketch:
    """Return 4 x 4 robots with 4 levels, which are all different in each row, column and long diagonal."""
    side = range(4)
    robots = tuple(SketchRobot(f"D{x + 1}{y + 1}", Cell(x, y)) for y in side for x in side)
    lines = [
        *([(x, y) for x in side] for y in side),
        *([(x, y) for y in side] for x in side),
        [(at, at) for at in side],
        [(at, 3 - at) for at in side],
    ]
    rules = _RuleList()
    for line in lines:
        rules.add("different", "level", *(f"D{x + 1}{y + 1}" for x, y in line))
    level = Decision("level", DecisionKind.LEVEL, (1, 2, 3, 4))
    return Sketch(area=Area(4, 4), robots=robots, decisions=(level,), rules=rules.all)


def _patrol() -> Sketch:
    area = Area(8, 5, frozenset({Cell(3, 2), Cell(4, 2)}))
    robots = _robots(Lead=(3, 1), North=(4, 4), South=(3, 0), West=(0, 2))
    posts = _numbers(area, (0, 2), (1, 4), (2, 1), (3, 3), (3, 0), (4, 4), (5, 1), (6, 3), (7, 2))
    rules = _RuleList().add("apart", "post", gap=3).add("leader-close", "post", "Lead", "North", "South", "West", gap=4)
    rules.add("north-of", "post", "North", "South")
    for name, wish, cost in (("Lead", (3, 3), 4), ("West", (0, 2), 2), ("South", (3, 0), 2), ("North", (4, 4), 1)):
        rules.add("prefers", "post", name, cost=cost, value=area.number(Cell(*wish)))
    return Sketch(area=area, robots=robots, decisions=(Decision("post", DecisionKind.PLACE, posts),), rules=rules.all)


def _rescue() -> Sketch:
    robots = _robots(Medic=(1, 1), Scout=(3, 3), Truck=(5, 1), Crane=(6, 3), Relay=(4, 4), Spare=(2, 0))
    task = Decision("task", DecisionKind.TASK, ("first aid", "search", "carry", "relay"))
    rules = _RuleList()
    rules.add("at-least", "task", value="carry", count=2).add("at-least", "task", value="search", count=1)
    rules.add("at-most", "task", value="relay", count=1).add("at-least", "task", value="relay", count=1)
    rules.add("only", "task", "Medic", values=["first aid", "search"])
    rules.add("never", "task", "Truck", "Crane", value="search")
    rules.add("same", "task", "Truck", "Crane").add("different", "task", "Medic", "Spare", "Scout")
    rules.add("prefers", "task", "Medic", cost=5, value="first aid").add(
        "prefers", "task", "Scout", cost=4, value="search"
    )
    rules.add("prefers", "task", "Relay", cost=3, value="relay").add(
        "prefers", "task", "Spare", cost=1, value="first aid"
    )
    return Sketch(area=Area(8, 5), robots=robots, decisions=(task,), rules=rules.all)


def _hangar() -> Sketch:
    robots = _robots(Nose=(1, 2), Roof=(3, 2), Port=(3, 4), Starboard=(3, 0), Fin=(5, 3), Tail=(6, 1))
    level = Decision("level", DecisionKind.LEVEL, (1, 2, 3, 4))
    rules = _RuleList().add("neighbours-different", "level", radius=3).add("neighbours-close", "level", radius=3, gap=2)
    rules.add("leader-above", "level", "Roof", "Port", "Starboard").add("only", "level", "Fin", values=[3, 4])
    return Sketch(area=Area(8, 5), robots=robots, decisions=(level,), rules=rules.all)


def _meetings() -> Sketch:
    robots = _robots(Ana=(1, 1), Bo=(2, 3), Chi=(5, 3), Dia=(6, 1), Emil=(4, 0))
    slot = Decision("slot", DecisionKind.SLOT, (9, 10, 11, 12))
    room = Decision("room", DecisionKind.CHOICE, ("garden", "hall", "roof"))
    rules = _RuleList().add("same", "slot", "Ana", "Bo").add("same", "room", "Ana", "Bo")
    rules.add("same", "slot", "Chi", "Dia", "Emil").add("same", "room", "Chi", "Dia", "Emil")
    rules.add("different", "slot", "Bo", "Chi").add("never", "room", "Emil", value="roof")
    rules.add("rather", "slot", "Ana", value=11, step=3).add("rather", "slot", "Bo", value=9, step=1)
    rules.add("rather", "slot", "Chi", "Emil", value=11, step=1).add("rather", "slot", "Dia", value=12, step=2)
    rules.add("prefers", "room", "Dia", cost=2, value="roof").add("prefers", "room", "Ana", cost=1, value="garden")
    return Sketch(area=Area(8, 5), robots=robots, decisions=(slot, room), rules=rules.all)


def _channels() -> Sketch:
    places = ((0, 0), (2, 1), (4, 0), (6, 1), (1, 3), (3, 2), (5, 3), (7, 2), (0, 5), (2, 4), (4, 5), (6, 5))
    robots = tuple(SketchRobot(f"Radio{number}", Cell(*place)) for number, place in enumerate(places, 1))
    channel = Decision("channel", DecisionKind.CHANNEL, (1, 2, 3, 4))
    rules = _RuleList().add("neighbours-different", "channel", radius=3)
    return Sketch(area=Area(8, 6), robots=robots, decisions=(channel,), rules=rules.all)


def _coverage() -> Sketch:
    walls = ((2, 1), (2, 2), (2, 3), (5, 2), (5, 3), (5, 4))
    area = Area(8, 5, frozenset(Cell(*wall) for wall in walls))
    robots = _robots(Base=(0, 0), Eye1=(1, 4), Eye2=(3, 2), Eye3=(4, 4), Eye4=(7, 1))
    rules = _RuleList().add("apart", "place", gap=3)
    rules.add("only", "place", "Base", values=[*_numbers(area, (0, 0), (0, 1), (1, 0))])
    rules.add("east-of", "place", "Eye4", "Eye1", "Eye2", "Eye3").add("leader-close", "place", "Eye3", "Eye4", gap=5)
    return Sketch(area=area, robots=robots, decisions=(Decision("place", DecisionKind.PLACE),), rules=rules.all)


def _convoy() -> Sketch:
    robots = _robots(First=(0, 2), Second=(2, 1), Third=(4, 2), Last=(6, 1), Guest=(5, 4))
    berth = Decision("slot", DecisionKind.SLOT, (1, 2, 3, 4, 5, 6))
    rules = _RuleList().add("in-order", "slot", "First", "Second", "Third", "Last").add("different", "slot")
    rules.add("close", "slot", "First", "Last", gap=4).add("only", "slot", "Guest", values=[2, 3])
    rules.add("little", "slot", "Last", step=2).add("rather", "slot", "First", value=1, step=1)
    return Sketch(area=Area(8, 5), robots=robots, decisions=(berth,), rules=rules.all)


def _secrets() -> Sketch:
    robots = _robots(Freight=(1, 1), Press=(4, 3), Survey=(6, 1))
    level = Decision("level", DecisionKind.LEVEL, (1, 2, 3, 4))
    rules = _RuleList().add("different", "level")
    rules.add("apart", "level", "Freight", "Press", private=True, gap=2)
    rules.add("close", "level", "Survey", "Freight", private=True, gap=1)
    rules.add("leader-above", "level", "Press", "Survey", private=True)
    rules.add("never", "level", "Press", private=True, value=4)
    return Sketch(area=Area(8, 5), robots=robots, decisions=(level,), rules=rules.all)


_MADE: dict[str, Callable[[], Sketch]] = {
    "cube": _cube,
    "patrol": _patrol,
    "hangar": _hangar,
    "coverage": _coverage,
    "secrets": _secrets,
    "charging": _charging,
    "rescue": _rescue,
    "meetings": _meetings,
    "channels": _channels,
    "convoy": _convoy,
}
KEYS: Sequence[str] = tuple(_MADE)
