"""Costs that mean nothing, and robots that do not agree on what costs are."""

from __future__ import annotations

from tests.support.broken_case import R1, R2, R3, case, predicate, relation, weighted

FUNCTION = """
  <functions>
    <function name="f1" return="int">
      <parameters>int X int Y</parameters>
      <expression>
        <functional>add(X,1)</functional>
      </expression>
    </function>
  </functions>"""


COSTS = [
    weighted("a cost that forbids the wrong way",
             [relation('<relation name="r1" semantics="soft">-infinity:1 1</relation>')],
             (R2, "<relation ", ("-infinity is not possible where costs are minimised", "write infinity"))),
    weighted("a cost of ten decimal places",
             [relation('<relation name="r1" semantics="soft">0.1234567891:1 1</relation>')],
             (R2, "<relation ", ("is not a cost", "9 places"))),
    weighted(
        "a cost finer than the scale",
        [
            (R2, 'type="DisWCSP"', 'type="DisWCSP" scale="0.1"'),
            relation('<relation name="r1" arity="2" semantics="soft" defaultCost="0.25"/>'),
        ],
        (R2, "<relation ", ("0.25 has more decimal places than the scale", 'write scale="0.01"')),
    ),
    weighted(
        "a cost too large in its scale",
        [
            (R2, 'type="DisWCSP"', 'type="DisWCSP" scale="0.001"'),
            relation(f'<relation name="r1" arity="2" semantics="soft" defaultCost="{"9" * 17}"/>'),
        ],
        (R2, "<relation ", "an integer has"),
    ),
    weighted("a scale that is no power of ten", [(R2, 'type="DisWCSP"', 'type="DisWCSP" scale="0.25"')],
             (R2, "<presentation", ("invalid scale '0.25'", "a power of ten"))),
    weighted("an infinite constant", [(R2, 'type="DisWCSP"', 'type="DisWCSP" constant="infinity"')],
             (R2, "<presentation", "'infinity' is not a cost")),
    case("maximize in a DisCSP", [(R2, 'type="DisCSP"', 'type="DisCSP" objective="maximize"')],
         (R2, "<presentation", ("a DisCSP cannot have an objective to maximise", "DisWCSP"))),
    case("a constant in a DisCSP", [(R2, 'type="DisCSP"', 'type="DisCSP" constant="1"')],
         (R2, "<presentation", "a DisCSP cannot have a constant cost")),
    case("a scale in a DisCSP", [(R2, 'type="DisCSP"', 'type="DisCSP" scale="0.1"')],
         (R2, "<presentation", "a DisCSP cannot have a scale of costs")),
    case("a function in a DisCSP", [(R2, "</predicates>", "</predicates>" + FUNCTION)],
         (R2, "<function ", ("a DisCSP cannot have a function, whose value is a cost", "DisWCSP"))),
    weighted("a function that is a Boolean", [(R2, "</predicates>", "</predicates>" + FUNCTION.replace("add", "ne"))],
             (R2, "<functional>ne(X,1)", ("function f1", "must be integer"))),
    weighted(
        "a function cannot have a cost",
        [
            (R2, "</predicates>", "</predicates>" + FUNCTION),
            (R2, 'name="C2" reference="r1"', 'name="C2" reference="f1" cost="0.5"'),
        ],
        (R2, 'name="C2"', ("a function cannot have a cost", "value is the cost")),
    ),
    weighted(
        "a predicate that is worth something where it is undefined",
        [
            predicate("eq(div(X,Y),add(i,j))"),
            (R2, 'name="C1" reference="p1"', 'name="C1" cost="-2" reference="p1"'),
        ],
        (R2, 'name="C1"', ("violating p1 is rewarded, but 'div' may be undefined", "write a function")),
    ),
    weighted("one that maximizes", [(R2, 'type="DisWCSP"', 'type="DisWCSP" objective="maximize"')],
             (R2, "<presentation", ("the robot maximizes costs, but 'Robot1' minimizes them", "Robot1.xml:3"))),
    weighted("too many digits in the unit of another",
             [(R1, 'name="C0"', f'name="C0" cost="{"9" * 17}"'), (R3, 'name="C4"', 'name="C4" cost="0.001"')],
             (R1, "<presentation", ("an integer has 20 digits", "3 decimal places"))),
]  # fmt: skip
