"""Random XCSP3 instances over all supported forms, with their meaning by the specification.

Each form is drawn with a truth that shares nothing with the reader. ACE 2.6 refuses some forms, and decides some not as
the specification does: `nValues` with `eq` counts (2,2,2) as two values, lengths of 0 are not ignored in `noOverlap`,
`notin` of a sum means `in`, closed values that do not ascend allow nothing, and a variable that is twice in a table,
or as index and value, is taken for two. Those are drawn only where ACE is not asked.
"""

from __future__ import annotations

import itertools
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from random import Random

Row = tuple[int, ...]
Truth = Callable[[Row], bool]
Form = tuple[str, Truth]

_RELATIONS: dict[str, Callable[[int, int], bool]] = {
    "lt": operator.lt, "le": operator.le, "ge": operator.ge, "gt": operator.gt, "eq": operator.eq, "ne": operator.ne,
}  # fmt: skip
_BY_ACE = ["lt", "le", "ge", "gt", "eq"]
"""The relations that ACE supports, as the specification has them, in all conditions."""


@dataclass
class Instance:
    """An instance in XML, and its solutions by brute force."""

    variables: str
    constraints: list[str]
    solutions: set[Row]
    forms: list[str]

    @property
    def xml(self) -> str:
        body = f"<variables>{self.variables}</variables><constraints>{''.join(self.constraints)}</constraints>"
        return f'<instance format="XCSP3" type="CSP">{body}</instance>'


class _Draw:
    """Draws forms over the variables `x[0]`, `x[1]`, ..., all with the values `low` to `high`."""

    def __init__(self, chance: Random, *, for_ace: bool) -> None:
        self.chance = chance
        self.for_ace = for_ace
        self.number = chance.randint(4, 5) if for_ace else chance.randint(3, 4)
        self.low = 0 if for_ace else chance.choice([0, 0, 0, -1])
        self.high = self.low + chance.randint(1, 3 if self.number == 3 + for_ace else 2)

    @property
    def values(self) -> range:
        return range(self.low, self.high + 1)

    def value(self) -> int:
        return self.chance.choice(self.values)

    def scope(self, least: int = 2) -> list[int]:
        """Places of different variables."""
        return self.chance.sample(range(self.number), self.chance.randint(least, self.number))

    def condition(
        self, low: int, high: int, scope: Sequence[int] = (), *, operators: Sequence[str] = ()
    ) -> tuple[str, Callable[[int, Row], bool]]:
        """A condition on a number that is about between `low` and `high`, and depends on the variables in `scope`."""
        word = self.chance.choice(operators or (_BY_ACE if self.for_ace else [*_RELATIONS, "in", "notin"]))
        if word in _RELATIONS:
            holds = _RELATIONS[word]
            others = [place for place in range(self.number) if not self.for_ace or place not in scope]
            if others and self.chance.random() < 0.3:
                place = self.chance.choice(others)
                return f"({word},x[{place}])", lambda number, row: holds(number, row[place])
            bound = self.chance.randint(low, high)
            return f"({word},{bound})", lambda number, _: holds(number, bound)
        if self.chance.random() < 0.5:
            first = self.chance.randint(low, high)
            last = first + self.chance.randint(0, 2)
            members, text = set(range(first, last + 1)), f"{first}..{last}"
        else:
            members = set(self.chance.choices(range(low, high + 1), k=2))
            text = "{" + ",".join(map(str, sorted(members))) + "}"
        return f"({word},{text})", lambda number, _: (number in members) == (word == "in")


def names(places: Sequence[int]) -> str:
    return " ".join(f"x[{place}]" for place in places)


def lists_of(draw: _Draw, number: int, width: int) -> list[list[int]]:
    if draw.for_ace:
        number, places = min(number, draw.number // width), draw.chance.sample(range(draw.number), draw.number)
        return [places[width * one : width * (one + 1)] for one in range(number)]
    return [[draw.chance.randrange(draw.number) for _ in range(width)] for _ in range(number)]


def written(lists: Sequence[Sequence[int]]) -> str:
    return "".join(f"<list> {names(one)} </list>" for one in lists)


def of(places: Sequence[int], row: Row) -> Row:
    return tuple(row[place] for place in places)


def tuples(rows: Sequence[Sequence[object]]) -> str:
    return "".join(f"({','.join(map(str, row))})" for row in rows)


# Forms


def intension(draw: _Draw) -> Form:
    text, value = _boolean(draw, 2)
    return f"<intension> {text} </intension>", lambda row: bool(value(row))


Term = tuple[str, Callable[[Row], int]]


def _boolean(draw: _Draw, depth: int) -> Term:
    kind = draw.chance.choice([*_RELATIONS, "in", *(["and", "or", "xor", "iff", "imp", "not"] if depth else [])])
    if kind in _RELATIONS:
        holds, (one, left), (other, right) = _RELATIONS[kind], _integer(draw, depth), _integer(draw, depth)
        return f"{kind}({one},{other})", lambda row: int(holds(left(row), right(row)))
    if kind == "in":
        (one, left), members = _integer(draw, depth), {draw.value(), draw.value() + 1}
        return f"in({one},set({','.join(map(str, members))}))", lambda row: int(left(row) in members)
    (one, left), (other, right) = _boolean(draw, depth - 1), _boolean(draw, depth - 1)
    if kind == "not":
        return f"not({one})", lambda row: int(not left(row))
    truths: dict[str, Callable[[int, int], int]] = {
        "and": lambda a, b: a & b, "or": lambda a, b: a | b, "xor": lambda a, b: a ^ b, "iff": lambda a, b: int(a == b),
        "imp": lambda a, b: int(a <= b),
    }  # fmt: skip
    return f"{kind}({one},{other})", lambda row: truths[kind](left(row), right(row))


def _integer(draw: _Draw, depth: int) -> Term:
    kind = draw.chance.choice(["x", "x", "number", *(["add", "sub", "mul", "dist", "min", "max", "abs", "neg", "sqr",
                                                      "div", "mod", "if"] if depth else [])])  # fmt: skip
    if kind == "x":
        place = draw.chance.randrange(draw.number)
        return f"x[{place}]", lambda row: row[place]
    if kind == "number":
        value = draw.value()
        return str(value), lambda _: value
    (one, left), (other, right) = _integer(draw, depth - 1), _integer(draw, depth - 1)
    if kind == "if":
        condition, truth = _boolean(draw, depth - 1)
        return f"if({condition},{one},{other})", lambda row: left(row) if truth(row) else right(row)
    if kind in {"abs", "neg", "sqr"}:
        unary: dict[str, Callable[[int], int]] = {"abs": abs, "neg": operator.neg, "sqr": lambda a: a * a}
        return f"{kind}({one})", lambda row: unary[kind](left(row))
    if kind in {"div", "mod"}:  # of numbers that are not negative: elsewhere programs differ
        by = draw.chance.randint(1, 3)
        return f"{kind}(abs({one}),{by})", lambda row: abs(left(row)) // by if kind == "div" else abs(left(row)) % by
    binary: dict[str, Callable[[int, int], int]] = {
        "add": operator.add, "sub": operator.sub, "mul": operator.mul, "dist": lambda a, b: abs(a - b), "min": min,
        "max": max,
    }  # fmt: skip
    return f"{kind}({one},{other})", lambda row: binary[kind](left(row), right(row))


def extension(draw: _Draw) -> Form:
    scope = draw.scope()
    is_starred = draw.chance.random() < 0.3
    cells = [*map(str, draw.values), *(["*"] if is_starred else [])]
    rows = sorted({tuple(draw.chance.choice(cells) for _ in scope) for _ in range(draw.chance.randint(1, 6))})
    kind = "supports" if draw.for_ace and is_starred else draw.chance.choice(["supports", "conflicts"])

    def is_listed(row: Row) -> bool:
        return any(all(cell in {"*", str(v)} for cell, v in zip(one, of(scope, row), strict=True)) for one in rows)

    xml = f"<extension><list> {names(scope)} </list><{kind}> {tuples(rows)} </{kind}></extension>"
    return xml, lambda row: is_listed(row) == (kind == "supports")


def unary_extension(draw: _Draw) -> Form:
    place, values = draw.chance.randrange(draw.number), sorted({draw.value(), draw.value()})
    kind = draw.chance.choice(["supports", "conflicts"])
    xml = f"<extension><list> x[{place}] </list><{kind}> {' '.join(map(str, values))} </{kind}></extension>"
    return xml, lambda row: (row[place] in values) == (kind == "supports")


def regular(draw: _Draw) -> Form:
    scope, states = draw.scope(), ["a", "b", "c"]
    arcs = {(state, value): draw.chance.choice(states) for state in states for value in draw.values}
    for arc in draw.chance.sample(sorted(arcs), len(arcs) // 4):
        if arc[0] != "a" or sum(state == "a" for state, _ in arcs) > 1:
            del arcs[arc]
    reached = sorted({"a", *(state for state, _ in arcs), *arcs.values()})
    final = set(draw.chance.sample(reached, draw.chance.randint(1, len(reached))))

    def accepts(row: Row) -> bool:
        state: str | None = "a"
        for value in of(scope, row):
            state = arcs.get((state, value)) if state else None
        return state in final

    moves = tuples([(state, value, after) for (state, value), after in sorted(arcs.items())])
    xml = f"<list> {names(scope)} </list><transitions> {moves} </transitions><start> a </start>"
    return f"<regular>{xml}<final> {' '.join(sorted(final))} </final></regular>", accepts


def mdd(draw: _Draw) -> Form:
    scope = draw.scope()
    rows = sorted({tuple(draw.value() for _ in scope) for _ in range(draw.chance.randint(1, 6))})
    paths = {row[:step]: f"n{number}" for number, (row, step) in enumerate(
        (row, step) for row in rows for step in range(len(row)))}  # fmt: skip
    moves = list(dict.fromkeys((paths[row[:step]], row[step], paths.get(row[: step + 1], "end"))
                               for step in range(len(scope)) for row in rows))  # fmt: skip
    xml = f"<mdd><list> {names(scope)} </list><transitions> {tuples(moves)} </transitions></mdd>"
    return xml, lambda row: of(scope, row) in rows


def all_different(draw: _Draw) -> Form:
    scope, spared = draw.scope(), draw.value()
    if draw.chance.random() < 0.5:
        return f"<allDifferent> {names(scope)} </allDifferent>", lambda row: len(set(of(scope, row))) == len(scope)
    xml = f"<allDifferent><list> {names(scope)} </list><except> {spared} </except></allDifferent>"
    return xml, lambda row: len({v for v in of(scope, row) if v != spared}) == sum(v != spared for v in of(scope, row))


def all_different_lists(draw: _Draw) -> Form:
    lists = lists_of(draw, draw.chance.randint(2, 3), 2)
    spared = [] if draw.for_ace else [(draw.value(), draw.value()) for _ in range(draw.chance.randint(0, 2))]
    xml = written(lists) + (f"<except> {tuples(spared)} </except>" if spared else "")

    def holds(row: Row) -> bool:
        chosen = [found for found in (of(one, row) for one in lists) if found not in spared]
        return len(set(chosen)) == len(chosen)

    return f"<allDifferent>{xml}</allDifferent>", holds


def all_different_matrix(draw: _Draw) -> Form:
    (a, b), (c, d) = lists_of(draw, 2, 2)
    xml = f"<allDifferent><matrix> (x[{a}],x[{b}])(x[{c}],x[{d}]) </matrix></allDifferent>"
    return xml, lambda row: row[a] != row[b] != row[d] != row[c] != row[a]


def all_equal(draw: _Draw) -> Form:
    scope = draw.scope()
    return f"<allEqual> {names(scope)} </allEqual>", lambda row: len(set(of(scope, row))) == 1


def all_equal_except(draw: _Draw) -> Form:
    scope, spared = draw.scope(3), draw.value()
    xml = f"<allEqual><list> {names(scope)} </list><except> {spared} </except></allEqual>"
    return xml, lambda row: len(set(of(scope, row)) - {spared}) <= 1


def all_equal_lists(draw: _Draw) -> Form:
    lists = lists_of(draw, 2, 2)
    return f"<allEqual>{written(lists)}</allEqual>", lambda row: len({of(one, row) for one in lists}) == 1


def ordered(draw: _Draw) -> Form:
    scope, word = draw.scope(), draw.chance.choice(["lt", "le", "ge", "gt"])
    lengths = [draw.chance.randint(0, 1) for _ in scope[1:]] if draw.chance.random() < 0.5 else []
    xml = f"<lengths> {' '.join(map(str, lengths))} </lengths>" if lengths else ""
    steps = list(zip(itertools.pairwise(scope), lengths or [0] * len(scope), strict=False))
    xml = f"<ordered><list> {names(scope)} </list>{xml}<operator> {word} </operator></ordered>"
    return xml, lambda row: all(_RELATIONS[word](row[a] + length, row[b]) for (a, b), length in steps)


def lex(draw: _Draw) -> Form:
    lists, word = lists_of(draw, draw.chance.randint(2, 3), 2), draw.chance.choice(["lt", "le", "ge", "gt"])
    kind = "lex" if draw.for_ace else draw.chance.choice(["lex", "ordered"])
    xml = f"<{kind}>{written(lists)}<operator> {word} </operator></{kind}>"
    compared = list(itertools.pairwise(lists))
    return xml, lambda row: all(getattr(operator, word)(of(a, row), of(b, row)) for a, b in compared)


def lex_matrix(draw: _Draw) -> Form:
    (a, b), (c, d) = lists_of(draw, 2, 2)
    word = draw.chance.choice(["lt", "le"])
    xml = f"<lex><matrix> (x[{a}],x[{b}])(x[{c}],x[{d}]) </matrix><operator> {word} </operator></lex>"
    holds = getattr(operator, word)
    return xml, lambda r: holds((r[a], r[b]), (r[c], r[d])) and holds((r[a], r[c]), (r[b], r[d]))


def precedence(draw: _Draw) -> Form:
    scope = draw.scope()
    values = draw.chance.sample(draw.values, draw.chance.randint(2, len(draw.values)))
    covered = not draw.for_ace and draw.chance.random() < 0.3
    head = "<values covered='true'>" if covered else "<values>"
    xml = f"<list> {names(scope)} </list>{head} {' '.join(map(str, values))} </values>"

    def holds(row: Row) -> bool:
        found = of(scope, row)
        first = [found.index(value) if value in found else len(found) for value in values]
        is_in_order = all(a < b or b == len(found) for a, b in itertools.pairwise(first))
        return is_in_order and not (covered and first[-1] == len(found))

    return f"<precedence>{xml}</precedence>", holds


def sum_of(draw: _Draw) -> Form:
    scope = draw.scope()
    condition, holds = draw.condition(-2, 6, scope)
    if draw.chance.random() < 0.3 and not draw.for_ace:
        by = [draw.chance.randrange(draw.number) for _ in scope]
        xml = f"<list> {names(scope)} </list><coeffs> {names(by)} </coeffs><condition> {condition} </condition>"
        pairs = list(zip(scope, by, strict=True))
        return f"<sum>{xml}</sum>", lambda row: holds(sum(row[a] * row[b] for a, b in pairs), row)
    factors = [draw.chance.choice([-2, -1, 1, 2, 3]) for _ in scope]
    xml = f"<list> {names(scope)} </list><coeffs> {' '.join(map(str, factors))} </coeffs>"
    xml += f"<condition> {condition} </condition>"
    return f"<sum>{xml}</sum>", lambda row: holds(sum(map(operator.mul, factors, of(scope, row))), row)


def count(draw: _Draw) -> Form:
    scope, values = draw.scope(), sorted({draw.value(), draw.value()})
    condition, holds = draw.condition(0, 3, scope)
    xml = f"<list> {names(scope)} </list><values> {' '.join(map(str, values))} </values>"
    xml += f"<condition> {condition} </condition>"
    return f"<count>{xml}</count>", lambda row: holds(sum(value in values for value in of(scope, row)), row)


def n_values(draw: _Draw) -> Form:
    scope, spared = draw.scope(3), set[int]()
    condition, holds = draw.condition(1, 3, scope, operators=["le", "lt"] if draw.for_ace else ())
    xml = ""
    if not draw.for_ace and draw.chance.random() < 0.5:
        spared = {draw.value()}
        xml = f"<except> {' '.join(map(str, spared))} </except>"
    xml = f"<nValues><list> {names(scope)} </list>{xml}<condition> {condition} </condition></nValues>"
    return xml, lambda row: holds(len(set(of(scope, row)) - spared), row)


def n_values_lists(draw: _Draw) -> Form:
    lists, spared = lists_of(draw, 3, 2), {(draw.value(), draw.value())}
    condition, holds = draw.condition(1, 3)
    with_spared = draw.chance.random() < 0.5
    xml = f"<except> {tuples(sorted(spared))} </except>" if with_spared else ""
    xml = f"<nValues>{written(lists)}{xml}<condition> {condition} </condition></nValues>"
    return xml, lambda row: holds(len({of(one, row) for one in lists} - (spared if with_spared else set())), row)


def cardinality(draw: _Draw) -> Form:
    scope, values = draw.scope(), draw.chance.sample(draw.values, 2)
    values = sorted(values) if draw.for_ace else values
    closed, least = draw.chance.random() < 0.5, [draw.chance.randint(0, 1) for _ in values]
    most = [one + draw.chance.randint(0, 2) for one in least]
    occurs = " ".join(f"{one}..{other}" if one < other else str(one) for one, other in zip(least, most, strict=True))
    head = (
        f"<list> {names(scope)} </list><values closed='{str(closed).lower()}'> {' '.join(map(str, values))} </values>"
    )

    def holds(row: Row) -> bool:
        found = of(scope, row)
        numbers = [found.count(value) for value in values]
        is_within = all(a <= n <= b for a, n, b in zip(least, numbers, most, strict=True))
        return is_within and (not closed or set(found) <= set(values))

    return f"<cardinality>{head}<occurs> {occurs} </occurs></cardinality>", holds


def extremum(draw: _Draw) -> Form:
    scope, kind = draw.scope(), draw.chance.choice(["minimum", "maximum"])
    condition, holds = draw.condition(draw.low, draw.high, scope)
    best = min if kind == "minimum" else max
    xml = f"<{kind}><list> {names(scope)} </list><condition> {condition} </condition></{kind}>"
    return xml, lambda row: holds(best(of(scope, row)), row)


def places_of_best(kind: str, rank: str, found: Row) -> list[int]:
    best = (min if kind.startswith("min") else max)(found)
    every = [place for place, value in enumerate(found) if value == best]
    return {"first": every[:1], "last": every[-1:]}.get(rank, every)


def extremum_with_index(draw: _Draw) -> Form:
    scope, kind, index = draw.scope(), draw.chance.choice(["minimum", "maximum"]), draw.chance.randrange(draw.number)
    rank, start = draw.chance.choice(["any", "first", "last"]), draw.chance.choice([0, 1])
    condition, holds = draw.condition(draw.low, draw.high)
    xml = f"<list startIndex='{start}'> {names(scope)} </list><index rank='{rank}'> x[{index}] </index>"
    has_condition = draw.chance.random() < 0.5
    xml += f"<condition> {condition} </condition>" if has_condition else ""
    best = min if kind == "minimum" else max

    def truth(row: Row) -> bool:
        found = of(scope, row)
        at_place = row[index] - start in places_of_best(kind, rank, found)
        return at_place and (not has_condition or holds(best(found), row))

    return f"<{kind}>{xml}</{kind}>", truth


def place_of_extremum(draw: _Draw) -> Form:
    scope, kind = draw.scope(), draw.chance.choice(["minimumArg", "maximumArg"])
    rank, start = draw.chance.choice(["any", "first", "last"]), draw.chance.choice([0, 1])
    condition, holds = draw.condition(0, 2)
    head = f"<list startIndex='{start}'>" if start else "<list>"
    xml = f"<{kind} rank='{rank}'>{head} {names(scope)} </list><condition> {condition} </condition></{kind}>"
    return xml, lambda row: any(holds(start + place, row) for place in places_of_best(kind, rank, of(scope, row)))


def element(draw: _Draw) -> Form:
    index, start = draw.chance.randrange(draw.number), 0 if draw.for_ace else draw.chance.choice([0, 1])
    scope = [place for place in draw.scope() if place != index] or [index]
    condition, holds = draw.condition(draw.low, draw.high, [*scope, index], operators=["eq"] if draw.for_ace else ())
    head = f" startIndex='{start}'" if start else ""
    if draw.chance.random() < 0.5 or (draw.for_ace and len(scope) <= draw.high):
        numbers: list[int] = [draw.value() for _ in range(3)]
        xml = f"<list{head}> {' '.join(map(str, numbers))} </list>"
        members: Callable[[Row], Sequence[int]] = lambda _: numbers  # noqa: E731 - one of two
    else:
        xml = f"<list{head}> {names(scope)} </list>"
        members = lambda row: of(scope, row)  # noqa: E731 - one of two

    def truth(row: Row) -> bool:
        place = row[index] - start
        return 0 <= place < len(members(row)) and holds(members(row)[place], row)

    return f"<element>{xml}<index> x[{index}] </index><condition> {condition} </condition></element>", truth


def element_of_matrix(draw: _Draw) -> Form:
    matrix = [[draw.value() for _ in range(3)] for _ in range(2)]
    i, j, k = draw.chance.sample(range(draw.number), 3)
    xml = f"<matrix> {tuples(matrix)} </matrix><index> x[{i}] x[{j}] </index><value> x[{k}] </value>"

    def truth(row: Row) -> bool:
        return 0 <= row[i] < 2 and 0 <= row[j] < 3 and matrix[row[i]][row[j]] == row[k]

    return f"<element>{xml}</element>", truth


def member(draw: _Draw) -> Form:
    scope, value = draw.scope(), draw.value()
    xml = f"<element><list> {names(scope)} </list><value> {value} </value></element>"
    return xml, lambda row: value in of(scope, row)


def channel(draw: _Draw) -> Form:
    every = list(range(draw.number))
    kind = draw.chance.choice(["one", "two", "value"])
    if draw.for_ace and draw.high + 1 < draw.number:
        return all_different(draw)
    if kind == "one" or draw.for_ace:
        xml = f"<channel> {names(every)} </channel>"
        return xml, lambda row: all(0 <= v < len(row) and row[v] == place for place, v in enumerate(row))
    draw.chance.shuffle(every)
    start = draw.chance.choice([0, 1])
    if kind == "value":
        here, place = every[:2], every[2]
        xml = f"<list startIndex='{start}'> {names(here)} </list><value> x[{place}] </value>"
        return f"<channel>{xml}</channel>", lambda row: of(here, row) == tuple(
            int(row[place] == start + number) for number in range(2)) and start <= row[place] < start + 2  # fmt: skip
    here, there = every[:1], every[1:]
    if draw.number > 3:
        here, there = every[:2], every[2:4]
    xml = f"<list startIndex='{start}'> {names(here)} </list><list> {names(there)} </list>"

    def truth(row: Row) -> bool:
        one, other = of(here, row), of(there, row)
        forth = all(0 <= j < len(other) and other[j] == start + i for i, j in enumerate(one))
        back = all(0 <= i - start < len(one) and one[i - start] == j for j, i in enumerate(other))
        return forth and (back or len(one) < len(other))

    return f"<channel>{xml}</channel>", truth


def no_overlap(draw: _Draw) -> Form:
    scope = draw.scope()
    lengths = [draw.chance.randint(int(draw.for_ace), 2) for _ in scope]
    tasks = list(zip(scope, lengths, strict=True))
    xml = (
        f"<noOverlap><origins> {names(scope)} </origins><lengths> {' '.join(map(str, lengths))} </lengths></noOverlap>"
    )

    def apart(one: tuple[int, int], other: tuple[int, int], row: Row) -> bool:
        (a, m), (b, n) = one, other
        return m == 0 or n == 0 or row[a] + m <= row[b] or row[b] + n <= row[a]

    return xml, lambda row: all(apart(one, other, row) for one, other in itertools.combinations(tasks, 2))


def no_overlap_of_boxes(draw: _Draw) -> Form:
    corners = lists_of(draw, 2, 2)
    sides = [[draw.chance.randint(1, 2) for _ in range(2)] for _ in range(2)]
    origins = tuples([[f"x[{place}]" for place in corner] for corner in corners])
    xml = f"<noOverlap><origins> {origins} </origins><lengths> {tuples(sides)} </lengths></noOverlap>"
    (one, other), (sizes, others) = corners, sides

    def truth(row: Row) -> bool:
        return any(row[a] + m <= row[b] or row[b] + n <= row[a]
                   for a, b, m, n in zip(one, other, sizes, others, strict=True))  # fmt: skip

    return xml, truth


def cumulative(draw: _Draw) -> Form:
    scope, bound = draw.scope(), draw.chance.randint(1, 4)
    lengths = [draw.chance.randint(1, 2) for _ in scope]
    heights = [draw.chance.randint(1, 3) for _ in scope]
    variable = draw.chance.random() < 0.3 and not draw.for_ace and draw.low == 0
    if variable:
        lengths[0] = -1
    words = ["x[0]" if length < 0 else str(length) for length in lengths]
    xml = f"<origins> {names(scope)} </origins><lengths> {' '.join(words)} </lengths>"
    xml += f"<heights> {' '.join(map(str, heights))} </heights><condition> (le,{bound}) </condition>"

    def truth(row: Row) -> bool:
        tasks = [(row[place], row[0] if length < 0 else length, height)
                 for place, length, height in zip(scope, lengths, heights, strict=True)]  # fmt: skip
        return all(sum(h for s, n, h in tasks if s <= time < s + n) <= bound for time in range(-2, 9))

    return f"<cumulative>{xml}</cumulative>", truth


def bin_packing(draw: _Draw) -> Form:
    scope = draw.scope(3)
    sizes = [draw.chance.randint(1, 3) for _ in scope]
    head = f"<list> {names(scope)} </list><sizes> {' '.join(map(str, sizes))} </sizes>"

    def load(row: Row, number: int) -> int:
        return sum(size for size, bin_of in zip(sizes, of(scope, row), strict=True) if bin_of == number)

    if draw.low or draw.for_ace or draw.chance.random() < 0.4:
        bound = draw.chance.randint(2, 5)
        xml = f"<binPacking>{head}<condition> (le,{bound}) </condition></binPacking>"
        return xml, lambda row: all(load(row, number) <= bound for number in draw.values)
    bounds = [draw.chance.randint(1, 4) for _ in draw.values]
    kind = draw.chance.choice(["limits", "loads", "conditions"])
    if kind == "conditions":
        conditions = [draw.condition(0, 4) for _ in draw.values]
        xml = f"{head}<conditions> {''.join(text for text, _ in conditions)} </conditions>"
        return f"<binPacking>{xml}</binPacking>", lambda row: all(
            holds(load(row, number), row) for number, (_, holds) in enumerate(conditions))  # fmt: skip
    holds = operator.le if kind == "limits" else operator.eq
    xml = f"<binPacking>{head}<{kind}> {' '.join(map(str, bounds))} </{kind}></binPacking>"
    return xml, lambda row: all(holds(load(row, number), bound) for number, bound in enumerate(bounds))


def knapsack(draw: _Draw) -> Form:
    scope = draw.scope()
    weights, profits = ([draw.chance.randint(1, 3) for _ in scope] for _ in range(2))
    most, least = draw.chance.randint(2, 9), draw.chance.randint(0, 5)
    if draw.low < 0:
        return all_equal(draw)
    xml = f"<list> {names(scope)} </list><weights> {' '.join(map(str, weights))} </weights>"
    xml += f"<condition> (le,{most}) </condition>"
    xml += f"<profits> {' '.join(map(str, profits))} </profits><condition> (ge,{least}) </condition>"

    def truth(row: Row) -> bool:
        found = of(scope, row)
        weight, profit = (sum(map(operator.mul, factors, found)) for factors in (weights, profits))
        return bool(weight <= most and profit >= least)

    return f"<knapsack>{xml}</knapsack>", truth


def circuit(draw: _Draw) -> Form:
    every, start = list(range(draw.number)), 0 if draw.for_ace else draw.chance.choice([0, 1])
    size = draw.chance.randint(2, draw.number) if draw.chance.random() < 0.3 and not draw.for_ace else 0

    def truth(row: Row) -> bool:
        after = [value - start for value in row]
        moving = [place for place in every if after[place] != place]
        if not moving or any(not 0 <= value < len(row) for value in after):
            return False
        place, seen = after[moving[0]], [moving[0]]
        while place != moving[0] and len(seen) <= len(row):
            seen.append(place)
            place = after[place]
        return sorted(seen) == moving and (not size or len(seen) == size)

    head = f" startIndex='{start}'" if start else ""
    xml = f"<list{head}> {names(every)} </list>" + (f"<size> {size} </size>" if size else "")
    return f"<circuit>{xml}</circuit>", truth


def instantiation(draw: _Draw) -> Form:
    scope = draw.scope(1)[:2]
    values = tuple(draw.value() for _ in scope)
    xml = f"<instantiation><list> {names(scope)} </list><values> {' '.join(map(str, values))} </values></instantiation>"
    return xml, lambda row: of(scope, row) == values


def clause(draw: _Draw) -> Form:
    signs = [(place, draw.chance.random() < 0.5) for place in draw.scope()]
    text = " ".join(f"x[{place}]" if sign else f"not(x[{place}])" for place, sign in signs)
    return f"<clause> {text} </clause>", lambda row: any(bool(row[place]) == sign for place, sign in signs)


def group(draw: _Draw) -> Form:
    word = draw.chance.choice(sorted(_RELATIONS))
    pairs = [draw.chance.sample(range(draw.number), 2) for _ in range(2)]
    args = "".join(f"<args> {names(pair)} 1 </args>" for pair in pairs)
    xml = f"<group><intension> {word}(add(%0,%2),%1) </intension>{args}</group>"
    return xml, lambda row: all(_RELATIONS[word](row[a] + 1, row[b]) for a, b in pairs)


def slide(draw: _Draw) -> Form:
    word, circular = draw.chance.choice(["le", "ne"]), draw.chance.random() < 0.5
    every = list(range(draw.number))
    xml = f"<list> {names(every)} </list><intension> {word}(%0,%1) </intension>"
    pairs = [*itertools.pairwise(every), *([(every[-1], 0)] if circular else [])]
    head = "<slide circular='true'>" if circular else "<slide>"
    return f"{head}{xml}</slide>", lambda row: all(_RELATIONS[word](row[a], row[b]) for a, b in pairs)


FOR_ALL: Sequence[Callable[[_Draw], Form]] = (
    intension, extension, unary_extension, regular, mdd, all_different, all_different_lists, all_different_matrix,
    all_equal, ordered, lex, lex_matrix, precedence, sum_of, count, n_values, cardinality, extremum,
    element, element_of_matrix, member, channel, no_overlap, no_overlap_of_boxes, cumulative, bin_packing, knapsack,
    circuit, instantiation, group, slide,
)  # fmt: skip
NOT_FOR_ACE: Sequence[Callable[[_Draw], Form]] = (
    all_equal_except, all_equal_lists, n_values_lists, extremum_with_index, place_of_extremum, clause,
)  # fmt: skip
KINDS = len(FOR_ALL) + len(NOT_FOR_ACE)
"""So many instances one after the other begin with a constraint of another form each."""


def random_instance(seed: int, *, for_ace: bool = False) -> Instance:
    """An instance of one to three constraints, most with solutions; with `for_ace`, of forms that ACE supports."""
    chance = Random(seed)
    forms = [*FOR_ALL, *([] if for_ace else NOT_FOR_ACE)]
    for _ in range(8):
        draw = _Draw(chance, for_ace=for_ace)
        chosen = [forms[seed % len(forms)], *chance.choices(forms, k=chance.randint(0, 2))]  # each form has its turn
        drawn = [form(draw) for form in chosen]
        rows = itertools.product(draw.values, repeat=draw.number)
        found = {row for row in rows if all(truth(row) for _, truth in drawn)}
        if found:
            break
    array = f'<array id="x" size="[{draw.number}]"> {draw.low}..{draw.high} </array>'
    return Instance(array, [xml for xml, _ in drawn], found, [form.__name__ for form in chosen])
