"""Forms of XCSP3's constraints, with their meaning by the specification: truths that share nothing with the reader."""

from __future__ import annotations

from collections.abc import Callable

Truth = Callable[..., bool]


def lists(*words: str) -> str:
    return "".join(f"<list> {word} </list>" for word in words)


FORMS: dict[str, tuple[str, Truth]] = {
    "intension": ("<intension> le(add(x[0],x[1]),x[2]) </intension>", lambda x, y, z: x + y <= z),
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
    "allDifferent": ("<allDifferent> x[] </allDifferent>", lambda *v: len(set(v)) == 3),
    "allDifferent except": ("<allDifferent><list> x[] </list><except> 0 </except></allDifferent>",
                            lambda *v: len([w for w in v if w]) == len({w for w in v if w})),
    "allDifferent of expressions": ("<allDifferent> add(x[0],1) x[1] x[2] </allDifferent>",
                                    lambda x, y, z: len({x + 1, y, z}) == 3),
    "allDifferent of lists": (f"<allDifferent>{lists('x[0..1]', 'x[1..2]')}</allDifferent>",
                              lambda x, y, z: (x, y) != (y, z)),
    "allEqual": ("<allEqual> x[] </allEqual>", lambda x, y, z: x == y == z),
    "ordered": ("<ordered><list> x[] </list><lengths> 1 0 </lengths><operator> le </operator></ordered>",
                lambda x, y, z: x + 1 <= y <= z),
    "lex": (f"<lex>{lists('x[0] x[1]', 'x[1] x[2]')}<operator> lt </operator></lex>", lambda x, y, z: (x, y) < (y, z)),
    "lex le": (f"<lex>{lists('x[0] x[1]', 'x[1] x[2]')}<operator> ge </operator></lex>",
               lambda x, y, z: (x, y) >= (y, z)),
    "sum": ("<sum><list> x[] </list><coeffs> 1 -2 3 </coeffs><condition> (in,1..3) </condition></sum>",
            lambda x, y, z: 1 <= x - 2 * y + 3 * z <= 3),
    "sum of variables": ("<sum><list> x[0] x[1] </list><condition> (ne,x[2]) </condition></sum>",
                         lambda x, y, z: x + y != z),
    "many coefficients": ("<sum><list> x[] </list><coeffs> 2x3 </coeffs><condition> (eq,4) </condition></sum>",
                          lambda *v: 2 * sum(v) == 4),
    "count": ("<count><list> x[] </list><values> 0 2 </values><condition> (ge,2) </condition></count>",
              lambda *v: sum(w in {0, 2} for w in v) >= 2),
    "count a variable": ("<count><list> x[0] x[1] </list><values> x[2] </values><condition>(eq,1)</condition></count>",
                         lambda x, y, z: (x == z) + (y == z) == 1),
    "nValues": ("<nValues><list> x[] </list><condition> (eq,2) </condition></nValues>", lambda *v: len(set(v)) == 2),
    "nValues except": ("<nValues><list> x[] </list><except> 1 </except><condition> (eq,1) </condition></nValues>",
                       lambda *v: len(set(v) - {1}) == 1),
    "cardinality": (("<cardinality><list> x[] </list><values closed='true'> 0 1 </values><occurs> 0..1 2 </occurs>"
                    "</cardinality>"), lambda *v: v.count(0) <= 1 and v.count(1) == 2 and 2 not in v),
    "minimum": ("<minimum><list> x[] </list><condition> (eq,1) </condition></minimum>", lambda *v: min(v) == 1),
    "maximum": ("<maximum><list> x[0..1] </list><condition> (lt,x[2]) </condition></maximum>",
                lambda x, y, z: max(x, y) < z),
    "element": ("<element><list> 2 0 1 </list><index> x[0] </index><value> x[1] </value></element>",
                lambda x, y, _: (2, 0, 1)[x] == y),
    "element of variables": (("<element><list> x[0] x[1] </list><index> x[2] </index><condition> (ge,1) </condition>"
                             "</element>"), lambda x, y, z: z < 2 and (x, y)[z] >= 1),
    "element from 1": (("<element><list startIndex='1'> x[0] x[1] </list><index> x[2] </index><value> 1 </value>"
                       "</element>"), lambda x, y, z: z >= 1 and (x, y)[z - 1] == 1),
    "element of a matrix": (("<element><matrix> (0,1)(2,0) </matrix><index> x[0] x[1] </index><value> x[2] </value>"
                            "</element>"), lambda x, y, z: max(x, y) < 2 and ((0, 1), (2, 0))[x][y] == z),
    "member": ("<element><list> x[0] x[1] </list><value> x[2] </value></element>", lambda x, y, z: z in {x, y}),
    "channel": ("<channel> x[] </channel>", lambda *v: all(v[w] == i for i, w in enumerate(v))),
    "instantiation": ("<instantiation><list> x[0] x[2] </list><values> 1 2 </values></instantiation>",
                      lambda x, _, z: (x, z) == (1, 2)),
    "clause": ("<clause> x[0] not(x[1]) </clause>", lambda x, y, _: x != 0 or y == 0),
    "precedence": ("<precedence><list> x[] </list><values> 0 1 2 </values></precedence>",
                   lambda *v: all(w == 0 or w - 1 in v[:i] for i, w in enumerate(v))),
    "circuit": ("<circuit> x[] </circuit>",
                lambda *v: v in {(1, 2, 0), (2, 0, 1), (1, 0, 2), (2, 1, 0), (0, 2, 1)}),
    "circuit of a size": ("<circuit><list> x[] </list><size> 3 </size></circuit>",
                          lambda *v: v in {(1, 2, 0), (2, 0, 1)}),
    "regular": (("<regular><list> x[] </list><transitions> (a,0,a)(a,1,b)(b,1,b)(b,2,c) </transitions><start>a</start>"
                "<final> b c </final></regular>"),
                lambda *v: v in {(0, 0, 1), (0, 1, 1), (1, 1, 1), (0, 1, 2), (1, 1, 2)}),
    "mdd": ("<mdd><list> x[] </list><transitions> (r,0,p)(r,1,q)(p,2,s)(q,0,s)(s,1,t) </transitions></mdd>",
            lambda *v: v in {(0, 2, 1), (1, 0, 1)}),
    "knapsack": (("<knapsack><list> x[] </list><weights> 1 2 3 </weights><condition> (le,6) </condition>"
                 "<profits> 2 1 1 </profits><condition> (ge,4) </condition></knapsack>"),
                 lambda x, y, z: x + 2 * y + 3 * z <= 6 and 2 * x + y + z >= 4),
    "binPacking": ("<binPacking><list> x[] </list><sizes> 2 3 1 </sizes><condition> (le,4) </condition></binPacking>",
                   lambda *v: all(sum(s for s, w in zip((2, 3, 1), v, strict=True) if w == b) <= 4 for b in v)),
    "noOverlap": ("<noOverlap><origins> x[] </origins><lengths> 1 2 0 </lengths></noOverlap>",
                  lambda x, y, _: x + 1 <= y or y + 2 <= x),
    "cumulative": (("<cumulative><origins> x[] </origins><lengths> 2 1 2 </lengths><heights> 1 2 1 </heights>"
                   "<condition> (le,2) </condition></cumulative>"),
                   lambda *v: all(sum(h for s, n, h in zip(v, (2, 1, 2), (1, 2, 1), strict=True) if s <= t < s + n) <= 2
                                  for t in range(5))),
    "cumulative of variables": (("<cumulative><origins> 0 x[0] </origins><lengths> 2 x[1] </lengths><heights> 1 2 "
                                "</heights><condition> (le,x[2]) </condition></cumulative>"),
                                lambda x, y, z: all((t < 2) + 2 * (x <= t < x + y) <= z for t in range(5))),
    "supports": ("<extension><list> x[0] x[2] </list><supports> (0,1)(2,*) </supports></extension>",
                 lambda x, _, z: (x, z) == (0, 1) or x == 2),
    "conflicts": ("<extension><list> x[] </list><conflicts> (0,*,1)(2,2,2) </conflicts></extension>",
                  lambda x, y, z: (x, z) != (0, 1) and (x, y, z) != (2, 2, 2)),
    "unary": ("<extension><list> x[1] </list><supports> 0 2..5 </supports></extension>", lambda _, y, __: y != 1),
    "no supports": ("<extension><list> x[0] x[1] </list><supports/></extension>", lambda *_: False),
    "a variable twice": ("<extension><list> x[0] x[0] </list><supports> (0,1)(1,1) </supports></extension>",
                         lambda x, *_: x == 1),
    "group": ("<group><intension> lt(%0,%1) </intension><args> x[0] x[1] </args><args> x[1] x[2] </args></group>",
              lambda x, y, z: x < y < z),
    "group of the rest": (("<group><sum><list> %1 %... </list><condition> (eq,%0) </condition></sum><args>3 x[]</args>"
                          "</group>"), lambda *v: sum(v) == 3),
    "slide": ("<slide><list> x[] </list><intension> le(%0,%1) </intension></slide>", lambda x, y, z: x <= y <= z),
    "circular slide": ("<slide circular='true'><list> x[] </list><intension> ne(%0,%1) </intension></slide>",
                       lambda x, y, z: x != y != z != x),
    "block": (("<block class='symmetry'><allEqual> x[0] x[1] </allEqual><block><allEqual> x[1..2] </allEqual></block>"
              "</block>"), lambda x, y, z: x == y == z),
    "allDifferent of lists except": (
        f"<allDifferent>{lists('x[0..1]', 'x[1..2]')}<except> (1,1)(0,0) </except></allDifferent>",
        lambda x, y, z: (x, y) != (y, z) or x == y == z != 2,
    ),
    "allDifferent of a matrix": ("<allDifferent><matrix> (x[0],x[1])(x[1],x[2]) </matrix></allDifferent>",
                                 lambda x, y, z: x != y != z),
    "allEqual except": ("<allEqual><list> x[] </list><except> 0 2 </except></allEqual>",
                        lambda *v: len(set(v) - {0, 2}) <= 1),
    "allEqual of lists": (f"<allEqual>{lists('x[0..1]', 'x[1..2]')}</allEqual>", lambda x, y, z: x == y == z),
    "allEqual of lists except": (
        f"<allEqual>{lists('x[0..1]', 'x[1..2]')}<except> (0,1) </except></allEqual>",
        lambda x, y, z: (x, y) == (y, z) or (0, 1) in {(x, y), (y, z)},
    ),
    "ordered without lengths": ("<ordered><list> x[] </list><operator> gt </operator></ordered>",
                                lambda x, y, z: x > y > z),
    "ordered of lists": (f"<ordered>{lists('x[0] x[1]', 'x[1] x[2]')}<operator> lt </operator></ordered>",
                         lambda x, y, z: (x, y) < (y, z)),
    "lex of a matrix": ("<lex><matrix> (x[0],x[1])(x[1],x[2]) </matrix><operator> le </operator></lex>",
                        lambda x, y, z: (x, y) <= (y, z)),
    "lex to a limit": ("<lex><list> x[] </list><limit> 1 1 0 </limit><operator> le </operator></lex>",
                       lambda *v: v <= (1, 1, 0)),
    "nValues of lists": (f"<nValues>{lists('x[0..1]', 'x[1..2]')}<condition> (eq,1) </condition></nValues>",
                         lambda x, y, z: (x, y) == (y, z)),
    "nValues of lists except": (
        f"<nValues>{lists('x[0..1]', 'x[1..2]')}<except> (1,1)(0,2) </except><condition> (le,1) </condition></nValues>",
        lambda x, y, z: len({(x, y), (y, z)} - {(1, 1), (0, 2)}) <= 1,
    ),
    "maximum at an index": ("<maximum><list> x[0..1] 1 </list><index> x[2] </index></maximum>",
                            lambda x, y, z: (x, y, 1)[z] == max(x, y, 1)),
    "maximum at the first index": (
        ("<maximum><list startIndex='1'> x[0..1] </list><index rank='first'> x[2] </index><condition> (ge,1) "
        "</condition></maximum>"),
        lambda x, y, z: max(x, y) >= 1 and z == (1 if x >= y else 2),
    ),
    "minimum at the last index": (
        "<minimum><list> x[0..1] </list><index rank='last'> x[2] </index><condition> (in,0..1) </condition></minimum>",
        lambda x, y, z: min(x, y) <= 1 and z == (0 if x < y else 1),
    ),
    "maximumArg": ("<maximumArg> <list> x[] </list> <condition> (ne,1) </condition> </maximumArg>",
                   lambda x, y, z: max(x, z) == max(x, y, z)),
    "first maximumArg": (
        "<maximumArg rank='first'><list startIndex='2'> x[] </list><condition> (eq,3) </condition></maximumArg>",
        lambda x, y, z: x < y >= z,
    ),
    "last minimumArg": ("<minimumArg rank='last'><list> x[0..1] </list><condition> (le,x[2]) </condition></minimumArg>",
                        lambda x, y, z: (1 if y <= x else 0) <= z),
    "channel of two lists": (f"<channel>{lists('x[0] x[1]', 'x[2] 0')}</channel>",
                             lambda x, y, z: (x, y, z) == (1, 0, 1)),
    "channel from 1": (
        "<channel><list startIndex='1'> x[0] x[1] </list><list> x[1] x[2] 2 </list></channel>",
        lambda x, y, z: x != y and (y, z, 2)[x] == 1 and (y, z, 2)[y] == 2,
    ),
    "channel to a value": ("<channel><list startIndex='1'> x[0] x[1] </list><value> x[2] </value></channel>",
                           lambda x, y, z: (x, y, z) in {(1, 0, 1), (0, 1, 2)}),
    "circuit from 1": ("<circuit><list startIndex='1'> x[0] x[1] </list></circuit>",
                       lambda x, y, _: (x, y) == (2, 1)),
    "precedence of all values": ("<precedence> x[] </precedence>",
                                 lambda *v: all(w == 0 or w - 1 in v[:i] for i, w in enumerate(v))),
    "precedence that covers": ("<precedence><list> x[] </list><values covered='true'> 0 1 </values></precedence>",
                               lambda *v: 1 in v and 0 in v[:v.index(1)]),
    "binPacking to limits": (
        "<binPacking><list> x[0..1] </list><sizes> 2 3 </sizes><limits> 3 x[2] </limits></binPacking>",
        lambda x, y, z: {x, y} <= {0, 1} and 2 * (x == 0) + 3 * (y == 0) <= 3 and 2 * (x == 1) + 3 * (y == 1) <= z,
    ),
    "binPacking with loads": (
        "<binPacking><list startIndex='1'> x[0..1] </list><sizes> 1 2 </sizes><loads> x[2] 2 </loads></binPacking>",
        lambda *v: v == (1, 2, 1),
    ),
    "binPacking with conditions": (
        ("<binPacking><list> x[] </list><sizes> 1 2 2 </sizes><conditions> (in,0..1) (ge,2)(ne,x[0]) </conditions>"
        "</binPacking>"),
        lambda x, y, z: (x == 0) + 2 * (y == 0) + 2 * (z == 0) <= 1 and (x == 1) + 2 * (y == 1) + 2 * (z == 1) >= 2
        and (x == 2) + 2 * (y == 2) + 2 * (z == 2) != x,
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
    "element at a condition of a variable": (
        "<element><list> 1 0 2 </list><index> x[0] </index><condition> (gt,x[1]) </condition></element>",
        lambda x, y, _: (1, 0, 2)[x] > y,
    ),
}  # fmt: skip
"""Each supported form of a constraint over `x[0] x[1] x[2]` with the values 0 to 2, and what it means."""
