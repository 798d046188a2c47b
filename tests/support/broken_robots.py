"""Robots that mean nothing: domains, definitions, constraints, topics."""

from __future__ import annotations

from tests.support.broken_case import D2, R1, R2, R3, RELATION, case, domain, predicate, weighted

P = """<predicate name="r1"><parameters/><expression><functional>eq(1,1)</functional></expression></predicate>"""
V2 = '<variable name="V2" domain="D1"/>'


def relation(text: str) -> tuple[str, str, str]:
    """Robot2 with another relation."""
    return (R2, RELATION, text)


DOMAINS = [
    case("a wrong count of domains", [(R2, 'nbDomains="1"', 'nbDomains="2"')], (R2, "<domains", "nbDomains is 2")),
    case("a wrong count of values", [(R2, 'nbValues="6"', 'nbValues="9"')], (R2, "<domain ", ("nbValues is 9", '"6"'))),
    case("a domain of 10^9 values", [domain("1..1000000000")], (R2, "<domain ", "more than 100000 values")),
    case("a domain of 10^18 values", [domain(f"-{'9' * 18}..{'9' * 18}")], (R2, "<domain ", "more than 100000 values")),
    case("an integer of 5000 digits", [domain("1.." + "9" * 5000)], (R2, "<domain ", ("is no range", "18 digits"))),
    case("a reversed range", [domain("4..1")], (R2, "<domain ", ("4..1 is empty", "1..4"))),
    case("overlapping ranges", [domain("1..4 3..6")], (R2, "<domain ", "3 stands twice")),
    case("a domain of words", [domain("red green")], (R2, "<domain ", "'red' is no range of integers")),
    case("digits of another script", [domain("\u0661..\u0664")], (R2, "<domain ", "is no range of integers")),
    case("an empty domain", [domain("")], (R2, "<domain ", "has no value")),
    case("two domains of one name", [(R2, D2, D2 + "\n" + D2), (R2, ' nbDomains="1"', "")],
         (R2, D2 + "\n  <", "a second domain 'D1'")),
    case("an unknown domain", [(R2, 'domain="D1"', 'domain="D2"')],
         (R2, "<variable ", ("domain 'D2'", "known domains: D1"))),
    case(
        "no variable",
        [
            (R1, '<variable name="V1" domain="D1"/>\n    <variable name="W1" domain="D1"/>', ""),
            (R1, 'nbVariables="2"', 'nbVariables="0"'),
        ],
        (R1, "<variables", "no variable"),
    ),
    case("two variables of one name", [(R2, V2, V2 + "\n" + V2), (R2, ' nbVariables="1"', "")],
         (R2, V2 + "\n  <", "a second variable 'V2'")),
]  # fmt: skip

DEFINITIONS = [
    case("a wrong count of tuples", [(R2, 'nbTuples="3"', 'nbTuples="4"')], (R2, "<relation ", "nbTuples is 4")),
    case("a tuple too short", [(R2, "|2 2|", "|2|")], (R2, "<relation ", ("'2' has 1 values instead of 2", "'|'"))),
    case("a tuple twice", [(R2, "|2 2|", "|1 1|")], (R2, "<relation ", "'1 1' stands twice")),
    case("a tuple of words", [(R2, "|2 2|", "|2 x|")], (R2, "<relation ", "'x' is no integer")),
    case("a tuple of 5000 digits", [(R2, "|2 2|", f"|2 {'9' * 5000}|")], (R2, "<relation ", "is no integer")),
    case("a relation of unknown arity", [relation('<relation name="r1" semantics="supports"/>')],
         (R2, "<relation ", "lacks its arity")),
    case("a soft relation in a DisCSP",
         [relation('<relation name="r1" semantics="soft" defaultCost="0">5:1 1</relation>')],
         (R2, "<relation ", "a soft relation in a DisCSP")),
    case("a defaultCost without soft", [(R2, 'semantics="conflicts"', 'semantics="conflicts" defaultCost="1"')],
         (R2, "<relation ", "defaultCost in a conflicts relation")),
    weighted("a soft tuple without cost",
             [relation('<relation name="r1" semantics="soft" defaultCost="infinity">1 1|5:2 2</relation>')],
             (R2, "<relation ", ("'1 1' has no cost", "cost:tuple"))),
    weighted("a cost that is no number",
             [relation('<relation name="r1" semantics="soft" defaultCost="0">.5:1 1</relation>')],
             (R2, "<relation ", ("'.5' is no cost", "at most 9 places"))),
    case("a predicate named like a relation",
         [(R2, '<predicate name="p1">', P + '\n<predicate name="p1">'), (R2, ' nbPredicates="1"', "")],
         (R2, '<predicate name="r1"', "a second definition 'r1'")),
    case("a predefined name", [(R2, '"p1"', '"neq"')], (R2, "<predicate ", "'neq' is a predefined predicate")),
    case("parameters of no type", [(R2, "int X int Y", "X Y")], (R2, "<predicate ", ("cannot be read", "int X int Y"))),
    case("two parameters of one name", [(R2, "int X int Y", "int X int X")], (R2, "<predicate ", "are called 'X'")),
    case("an unknown operator", [predicate("nee(X,Y)")], (R2, "<functional", ("operator 'nee'", "did you mean 'ne"))),
    case("an unknown parameter", [predicate("ne(X,Z)")], (R2, "<functional", ("unknown name 'Z'", "X Y i j"))),
    case("a predicate that is a number", [predicate("add(X,Y)")], (R2, "<functional", "should be Boolean")),
    case("infix in the wrong function", [predicate("ne(X-Y)")], (R2, "<functional", "write ne(sub(X,Y), ...)")),
    case("a mistake on the third line", [predicate("\n\nne(X,)")], (R2, "ne(X,)", "where a term should stand")),
    case("an empty predicate", [predicate("")], (R2, "<functional", "where a term should stand")),
    case("deep expressions", [predicate("abs(" * 9000 + "X" + ")" * 9000)], (R2, "<functional", "nested too deeply")),
    case("a long expression", [predicate("ne(X,Y)" + " " * 70_000)], (R2, "<functional", "65536 are allowed")),
    case("Python for an expression", [predicate("__import__('os')")], (R2, "<functional", "unknown operator")),
    case("a topic over another's variable", [(R3, 'z="V3"', 'z="V1"')], (R3, "<topic ", ("z of the topic", "'V1'"))),
    case("a topic of a Boolean", [(R3, 'z="V3"', 'z="eq(V3,1)"')], (R3, "<topic ", "should be integer")),
]  # fmt: skip

CONSTRAINTS = [
    case("a wrong count of constraints",
         [(R1, '<constraints nbConstraints="1">\n    <', '<constraints nbConstraints="3">\n    <')],
         (R1, "<constraints", "nbConstraints is 3, but there are 1")),
    case("an unknown reference", [(R3, 'reference="sum"', 'reference="sun"')],
         (R3, 'name="C5"', ("'sun'", "mean 'sum'"))),
    case("no variables in a scope", [(R3, 'scope="V1 V3"', 'scope="1 3"')], (R3, 'name="C4"', "without variables")),
    case("a scope of other characters", [(R3, 'scope="V1 V3"', 'scope="V1,V3"')],
         (R3, 'name="C4"', ("'V1,V3'", "blanks"))),
    case("a constant of 5000 digits", [(R2, "V1 V2 1 2", "V1 V2 1 " + "2" * 5000)],
         (R2, 'name="C1"', "nor an integer")),
    case("too few terms", [(R3, 'scope="W1 V2 V3"', 'scope="V2 V3"')],
         (R3, 'name="C5"', "sum takes 3 terms, but 'V2 V3' has 2")),
    case("a relation of another arity", [(R2, '"r1" scope="V1 V2"', '"r1" scope="V1 V2 3"')],
         (R2, 'name="C2"', "r1 takes 2 terms")),
    case("a parameter outside the scope", [(R2, 'scope="V1 V2 1 2"', 'scope="V2 1 2"')],
         (R2, 'name="C1"', "'V1' is not in the scope")),
    case("a scope that is not passed", [(R2, "<parameters>V1 V2 1 2", "<parameters>V1 V2 1 3")],
         (R2, 'name="C1"', "'2' is in the scope but not")),
    case(
        "parameters of a relation",
        [
            (R2, 'name="C1" reference="p1"', 'name="C1" reference="r1"'),
            (R2, "<parameters>V1 V2 1 2", "<parameters>V1 V2"),
        ],
        (R2, 'name="C1"', "differ from the scope"),
    ),
    case("a wrong arity", [(R3, 'name="C4"', 'name="C4" arity="3"')], (R3, 'name="C4"', ("arity is 3", "2 variables"))),
    case("a private constraint with a part", [(R1, 'name="C0"', 'name="C0" model="PKC"')],
         (R1, 'name="C0"', "private constraint with model PKC")),
    case("another's variable in private", [(R1, 'V1 W1"/>\n  <', 'V1 V2"/>\n  <')],
         (R1, 'name="C0"', ("'V2'", "agents_parent"))),
    case("own variables only with a parent", [(R3, 'scope="V1 V3"', 'scope="V3 3"')],
         (R3, 'name="C4"', "no variable of the neighbour")),
    case("others' variables only", [(R3, 'scope="V1 V3"', 'scope="V1 W1"')],
         (R3, 'name="C4"', "no variable of this robot")),
    case("a cost in a DisCSP", [(R3, 'name="C4"', 'name="C4" cost="3"')],
         (R3, 'name="C4"', ("a cost in a DisCSP", "DisWCSP"))),
    weighted("a cost on a relation", [(R2, 'name="C2"', 'name="C2" cost="3"')],
             (R2, 'name="C2"', "a cost on a relation")),
]  # fmt: skip
