"""Robots of all shapes that a file can say, for what is written and read back."""

from __future__ import annotations

from hypothesis import strategies as st

from robochoc.formats import PREDEFINED
from robochoc.model.cost_units import PLAIN_COSTS, CostUnits
from robochoc.model.expression import Apply, Constant, Expression, Name
from robochoc.model.problem import (
    INFINITE,
    Child,
    Constraint,
    ConstraintModel,
    Domain,
    Function,
    Parent,
    Predicate,
    ProblemKind,
    Relation,
    Robot,
    Semantics,
    Topic,
    Variable,
)

WORDS = st.from_regex(r"[A-Za-z][A-Za-z0-9_.]{0,4}", fullmatch=True)
INTEGERS = st.integers(-50, 50)
COSTS = st.one_of(st.integers(-99, 99), st.integers(1 - 10**18, 10**18 - 1))
SYMBOLS = ("red", "green", "X", "dark-blue", "10am", "eq", "p0", "(a,b)", "é")
UNITS = st.builds(CostUnits, st.booleans(), st.integers(0, 9), COSTS)


@st.composite
def _domains(draw: st.DrawFn, name: str) -> Domain:
    starts = sorted(draw(st.sets(INTEGERS, min_size=1, max_size=4)))
    ends = [
        draw(st.integers(start + 1, max(start + 1, following - 1)))
        for start, following in zip(starts, [*starts[1:], 99], strict=True)
    ]
    parts = [range(start, end) for start, end in zip(starts, ends, strict=True)]
    apart = [
        part
        for part, following in zip(parts, [*parts[1:], range(999, 1000)], strict=True)
        if part.stop < following.start
    ]
    return Domain(name, tuple(apart))


@st.composite
def _relations(draw: st.DrawFn, name: str, arity: int, kind: ProblemKind) -> Relation:
    semantics = draw(
        st.sampled_from(Semantics if kind is ProblemKind.DISWCSP else [Semantics.SUPPORTS, Semantics.CONFLICTS])
    )
    tuples = tuple(draw(st.lists(st.tuples(*[INTEGERS] * arity), unique=True, max_size=5)))
    if semantics is not Semantics.SOFT:
        return Relation(name, arity, semantics, tuples)
    costs = st.one_of(COSTS, st.just(INFINITE))
    return Relation(name, arity, semantics, tuples, tuple(draw(costs) for _ in tuples), draw(costs))


@st.composite
def _about_symbols(draw: st.DrawFn, name: str, kind: ProblemKind, arity: int) -> Relation | Predicate | Function:
    """A definition whose first parameter is a symbol, and of whose others nothing is known."""
    codes = st.integers(0, len(SYMBOLS) - 1)
    if draw(st.booleans()):
        rows = st.lists(st.tuples(codes, *[INTEGERS] * (arity - 1)), unique=True, min_size=1, max_size=5)
        return Relation(name, arity, Semantics.SUPPORTS, tuple(draw(rows)), symbolic=(0,))
    formal = tuple(f"p{index}" for index in range(arity))
    members = draw(st.lists(st.builds(Constant, codes), min_size=1, max_size=3))
    body = Apply(draw(st.sampled_from(["in", "eq"])), (Name("p0"), *members))
    if kind is ProblemKind.DISWCSP and draw(st.booleans()):
        otherwise = Name(formal[-1]) if arity > 1 else Constant(0)
        return Function(name, formal, Apply("if", (body, Constant(2), otherwise)), ("p0",))
    return Predicate(name, formal, body, ("p0",))


@st.composite
def _constraints(
    draw: st.DrawFn, scope: tuple[str, ...], kind: ProblemKind, model: ConstraintModel | None, number: int
) -> Constraint:
    name, described = f"C{number}", f"d{number}"
    if scope[0].startswith("s_"):
        return Constraint(name, draw(_about_symbols(described, kind, len(scope))), scope, scope, model)
    if draw(st.booleans()):
        return Constraint(name, draw(_relations(described, len(scope), kind)), scope, scope, model)
    extra = tuple(draw(st.lists(INTEGERS, max_size=2)))
    formal = tuple(f"p{index}" for index in range(len(scope) + len(extra)))
    body: Expression = Apply(draw(st.sampled_from(["ne", "lt", "ge"])), (Name(formal[0]), Constant(draw(INTEGERS))))
    for parameter in formal[1:]:
        body = Apply("or", (body, Apply("eq", (Name(parameter), Constant(0)))))
    if kind is ProblemKind.DISWCSP and draw(st.booleans()):
        value = Apply("if", (body, Constant(draw(INTEGERS)), Name(formal[-1])))
        return Constraint(name, Function(described, formal, value), (*scope, *extra), (*scope, *extra), model)
    cost = draw(COSTS) if kind is ProblemKind.DISWCSP and draw(st.booleans()) else INFINITE
    predicate = Predicate(described, formal, body)
    if len(formal) == 2 and draw(st.booleans()):
        predicate = PREDEFINED[draw(st.sampled_from(sorted(PREDEFINED)))]
    return Constraint(name, predicate, (*scope, *extra), (*scope, *extra), model, cost)


@st.composite
def random_robots(draw: st.DrawFn) -> Robot:
    kind = draw(st.sampled_from(ProblemKind))
    costs = draw(UNITS) if kind is ProblemKind.DISWCSP else PLAIN_COSTS
    names = draw(st.lists(WORDS, min_size=1, max_size=3, unique=True))
    values = [draw(_domains(f"D{number}")) for number in range(2)]
    variables = tuple(Variable(name, draw(st.sampled_from(values))) for name in names)
    told_apart: tuple[str, ...] = ()
    whose = draw(st.sampled_from(("no symbols", "own", "others'")))
    if whose == "own":
        codes = sorted(draw(st.sets(st.integers(0, len(SYMBOLS) - 1), min_size=1)))
        domain = Domain("S", tuple(range(code, code + 1) for code in codes), SYMBOLS)
        variables += (Variable("s_own", domain),)
        names.insert(0, "s_own")
    elif whose == "others'":
        told_apart = SYMBOLS
    others = draw(
        st.lists(WORDS, min_size=1, max_size=4, unique=True).map(lambda words: [f"z_{word}" for word in words])
    )
    count = iter(range(99))

    def shared(model: ConstraintModel, other: str) -> tuple[Constraint, ...]:
        scope = (draw(st.sampled_from(names)), f"other_{other}")
        return tuple(draw(_constraints(scope, kind, model, next(count))) for _ in range(draw(st.integers(0, 2))))

    private = tuple(draw(_constraints(tuple(names), kind, None, next(count))) for _ in range(draw(st.integers(0, 2))))
    split = draw(st.integers(0, len(others)))
    parents = tuple(Parent(other, shared(draw(st.sampled_from(ConstraintModel)), other)) for other in others[:split])
    told = [tuple(name for name in names if draw(st.booleans())) for _ in others]
    children = tuple(
        Child(other, told[i], shared(ConstraintModel.PKC, other)) for i, other in enumerate(others[split:])
    )
    where = st.one_of(
        st.none(),
        st.builds(Constant, INTEGERS),
        st.builds(Name, st.sampled_from([one for one in names if one != "s_own"])),
    )
    topics = tuple(
        Topic(f"/t{i}", draw(st.sampled_from([Topic.type, "std/Int"])), x=draw(where))
        for i in range(draw(st.integers(0, 2)))
    )
    weight = draw(st.sampled_from((1, 1, 2, 1_000_000)))
    return Robot(
        "Robot1", variables, kind, private, parents, children, topics, weight=weight, costs=costs, symbols=told_apart
    )
