"""Forms of XCSP3's constraints that `xcsp3_random.py` does not draw, with their meaning by the specification."""

from __future__ import annotations

from collections.abc import Callable

Truth = Callable[..., bool]


def lists(*words: str) -> str:
    return "".join(f"<list> {word} </list>" for word in words)


FORMS: dict[str, tuple[str, Truth]] = {
    "function": ("<intension><function> imp(eq(x[0],1),ne(x[1],x[2])) </function></intension>",
                 lambda x, y, z: x != 1 or y != z),
    "integers as Booleans": ("<intension> and(x[0],or(x[1],not(x[2]))) </intension>",
                             lambda x, y, z: x != 0 and (y != 0 or z == 0)),
    "Booleans as integers": ("<intension> eq(add(eq(x[0],1),gt(x[1],0)),x[2]) </intension>",
                             lambda x, y, z: (x == 1) + (y > 0) == z),
    "n-ary": ("<intension> or(eq(x[0],x[1],x[2]),xor(x[0],x[1],x[2])) </intension>",
              lambda x, y, z: x == y == z or ((x > 0) + (y > 0) + (z > 0)) % 2 == 1),
    "sets": ("<intension> and(in(x[0],set(0,2)),notin(x[1],set(1)),in(x[2],set(x[0],add(x[1],1)))) </intension>",
             lambda x, y, z: x in {0, 2} and y != 1 and z in {x, y + 1}),
    "operators": ("<intension> eq(dist(sqr(x[0]),mod(x[1],2)),if(x[2],neg(-1),div(x[0],2))) </intension>",
                  lambda x, y, z: abs(x * x - y % 2) == (1 if z else x // 2)),
    "division by zero": ("<intension> ge(div(2,x[0]),x[1]) </intension>", lambda x, y, _: x != 0 and 2 // x >= y),
    "allDifferent of expressions": ("<allDifferent> add(x[0],1) x[1] x[2] </allDifferent>",
                                    lambda x, y, z: len({x + 1, y, z}) == 3),
    "many coefficients": ("<sum><list> x[] </list><coeffs> 2x3 </coeffs><condition> (eq,4) </condition></sum>",
                          lambda *v: 2 * sum(v) == 4),
    "count a variable": ("<count><list> x[0] x[1] </list><values> x[2] </values><condition>(eq,1)</condition></count>",
                         lambda x, y, z: (x == z) + (y == z) == 1),
    "element": ("<element><list> 2 0 1 </list><index> x[0] </index><value> x[1] </value></element>",
                lambda x, y, _: (2, 0, 1)[x] == y),
    "member": ("<element><list> x[0] x[1] </list><value> x[2] </value></element>", lambda x, y, z: z in {x, y}),
    "cumulative of variables": (("<cumulative><origins> 0 x[0] </origins><lengths> 2 x[1] </lengths><heights> 1 2 "
                                "</heights><condition> (le,x[2]) </condition></cumulative>"),
                                lambda x, y, z: all((t < 2) + 2 * (x <= t < x + y) <= z for t in range(5))),
    "unary": ("<extension><list> x[1] </list><supports> 0 2..5 </supports></extension>", lambda _, y, __: y != 1),
    "no supports": ("<extension><list> x[0] x[1] </list><supports/></extension>", lambda *_: False),
    "a variable twice": ("<extension><list> x[0] x[0] </list><supports> (0,1)(1,1) </supports></extension>",
                         lambda x, *_: x == 1),
    "group of the rest": (("<group><sum><list> %1 %... </list><condition> (eq,%0) </condition></sum><args>3 x[]</args>"
                          "</group>"), lambda *v: sum(v) == 3),
    "block": (("<block class='symmetry'><allEqual> x[0] x[1] </allEqual><block><allEqual> x[1..2] </allEqual></block>"
              "</block>"), lambda x, y, z: x == y == z),
    "allEqual except": ("<allEqual><list> x[] </list><except> 0 2 </except></allEqual>",
                        lambda *v: len(set(v) - {0, 2}) <= 1),
    "allEqual of lists except": (
        f"<allEqual>{lists('x[0..1]', 'x[1..2]')}<except> (0,1) </except></allEqual>",
        lambda x, y, z: (x, y) == (y, z) or (0, 1) in {(x, y), (y, z)},
    ),
    "lex to a limit": ("<lex><list> x[] </list><limit> 1 1 0 </limit><operator> le </operator></lex>",
                       lambda *v: v <= (1, 1, 0)),
    "maximum at an index": ("<maximum><list> x[0..1] 1 </list><index> x[2] </index></maximum>",
                            lambda x, y, z: (x, y, 1)[z] == max(x, y, 1)),
    "channel of two lists": (f"<channel>{lists('x[0] x[1]', 'x[2] 0')}</channel>",
                             lambda x, y, z: (x, y, z) == (1, 0, 1)),
    "precedence of all values": ("<precedence> x[] </precedence>",
                                 lambda *v: all(w == 0 or w - 1 in v[:i] for i, w in enumerate(v))),
    "binPacking to limits": (
        "<binPacking><list> x[0..1] </list><sizes> 2 3 </sizes><limits> 3 x[2] </limits></binPacking>",
        lambda x, y, z: {x, y} <= {0, 1} and 2 * (x == 0) + 3 * (y == 0) <= 3 and 2 * (x == 1) + 3 * (y == 1) <= z,
    ),
    "binPacking with loads": (
        "<binPacking><list startIndex='1'> x[0..1] </list><sizes> 1 2 </sizes><loads> x[2] 2 </loads></binPacking>",
        lambda *v: v == (1, 2, 1),
    ),
    "noOverlap of boxes": (
        ("<noOverlap zeroIgnored='false'><origins> (x[0],0)(x[1],x[2]) </origins><lengths> (1,2)(2,0) </lengths>"
        "</noOverlap>"),
        lambda x, y, z: x + 1 <= y or y + 2 <= x or z >= 2 or z <= 0,
    ),
    "cumulative with ends": (
        ("<cumulative><origins> x[0] 0 </origins><lengths> x[1] 2 </lengths><ends> x[2] 2 </ends>"
        "<heights> 1 2 </heights><condition> (le,2) </condition></cumulative>"),
        lambda x, y, z: x + y == z and (y == 0 or x >= 2),
    ),
}  # fmt: skip
"""Constraints over `x[0] x[1] x[2]` with the values 0 to 2, and what they mean."""
