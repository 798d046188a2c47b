"""All mutants of a file: its text, changed in one place, such as `<` for `<=`, or with a statement left out.

Parts without effect on a run stay as they are: annotations, `assert`, `case never`, and the wording of messages (`Act`,
`in_words`, f-strings).
"""

from __future__ import annotations

import ast
import difflib
from collections import Counter
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass
from typing import NamedTuple

from tests.mutation.marks import functions

COMPARED: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
COMPUTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.FloorDiv,
    ast.FloorDiv: ast.Mult,
    ast.Div: ast.Mult,
    ast.Mod: ast.FloorDiv,
}
CALLED = {"min": "max", "max": "min", "any": "all", "all": "any"}
EITHER = ("isinstance", "minimum", "maximum", "gcd", "array_equal")
"""Functions whose arguments are not exchanged: it has no effect, or fails at once."""
LEFT_OUT = (ast.AugAssign, ast.Delete, ast.Raise, ast.Continue, ast.Break)
NOTHING = ("None", "False", "''", "()")
"""What a `return` might as well not return."""
SKIPPED = ("annotation", "returns", "decorator_list")


class Place(NamedTuple):
    """A place that survives changes elsewhere in the file: a function, one of its lines, and a change of that line."""

    path: str
    function: str
    line: str
    old: str
    new: str
    nth: int


@dataclass(frozen=True)
class Mutant:
    """The text of a file with one change: the bytes from `start` to `end` replaced by `new`."""

    path: str
    number: int
    place: Place
    source: str
    start: int
    end: int
    new: str

    @property
    def text(self) -> str:
        """The whole file."""
        content = self.source.encode()
        return (content[: self.start] + self.new.encode() + content[self.end :]).decode()

    @property
    def diff(self) -> str:
        """What was changed."""
        lines = self.source.splitlines(), self.text.splitlines()
        return "\n".join(list(difflib.unified_diff(*lines, self.path, self.path, lineterm="", n=2))[2:])

    def __str__(self) -> str:
        return f"{self.path}:{self.number}"


def mutants_of(path: str, source: str) -> list[Mutant]:
    """Return all mutants of a file, numbered in the order of their places."""
    starts = [0]
    for line in source.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    tree, content = ast.parse(source), source.encode()
    changes = set()
    for node, new in _changes(tree):
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        start, end = starts[node.lineno - 1] + node.col_offset, starts[node.end_lineno - 1] + node.end_col_offset
        changes.add((start, end, new, node.lineno))
    owners = {
        line: name
        for name, function in functions(tree)
        for line in range(function.lineno, (function.end_lineno or 0) + 1)
    }
    lines, mutants, seen = source.splitlines(), list[Mutant](), Counter[Place]()
    for number, (start, end, new, row) in enumerate(sorted(changes)):
        place = Place(path, owners.get(row, ""), lines[row - 1].strip(), content[start:end].decode(), new, 0)
        mutants.append(Mutant(path, number, place._replace(nth=seen[place]), source, start, end, new))
        seen[place] += 1
    return mutants


def _changes(node: ast.AST) -> Iterator[tuple[ast.expr | ast.stmt, str]]:
    """Yield expressions and statements below `node`, each with what could stand in its place."""
    if _has_no_effect(node):
        return
    if isinstance(node, ast.stmt):
        yield from ((node, new) for new in _statements(node))
    elif isinstance(node, ast.expr):
        yield from ((node, f"({new})") for new in _expressions(node))
    if isinstance(node, ast.If | ast.While | ast.IfExp) and isinstance(node.test, ast.Name | ast.Attribute | ast.Call):
        yield node.test, f"(not {ast.unparse(node.test)})"
    for name, child in ast.iter_fields(node):
        if name not in SKIPPED and not (isinstance(node, ast.ClassDef) and name == "keywords"):
            for part in child if isinstance(child, list) else [child]:
                if isinstance(part, ast.AST):
                    yield from _changes(part)


def _has_no_effect(node: ast.AST) -> bool:
    match node:
        case ast.FunctionDef(name="in_words") | ast.Assert() | ast.JoinedStr():
            return True
        case ast.match_case(pattern=part) | ast.Call(func=part) | ast.If(test=part):
            return ast.unparse(part) in {"never", "Act", "TYPE_CHECKING"}
        case _:
            return False


def _statements(node: ast.stmt) -> Iterator[str]:
    stored = isinstance(node, ast.Assign) and not any(
        isinstance(target, ast.Name | ast.Tuple) for target in node.targets
    )
    if stored or isinstance(node, LEFT_OUT) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)):
        yield "pass"
    elif isinstance(node, ast.Return) and node.value is not None and ast.unparse(node.value) not in NOTHING:
        yield "return None"


def _expressions(node: ast.expr) -> Iterator[str]:
    match node:
        case ast.Compare(ops=[op, *others]):
            yield from (_with(node, ops=[new(), *others]) for new in COMPARED[type(op)])
        case ast.BoolOp(op=op):
            yield _with(node, op=ast.Or() if isinstance(op, ast.And) else ast.And())
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            yield ast.unparse(operand)
        case ast.BinOp(op=op) if type(op) in COMPUTED:
            yield _with(node, op=COMPUTED[type(op)]())
        case ast.Constant(value=bool(value)):
            yield str(not value)
        case ast.Constant(value=int(value) | float(value)):
            yield str(value + 1)
        case ast.IfExp(test=test, body=body, orelse=orelse):
            yield _with(node, test=test, body=orelse, orelse=body)
        case ast.Call(func=ast.Name(id=name)) if name in CALLED:
            yield _with(node, func=ast.Name(CALLED[name]))
        case ast.Call(args=[first, second, *others]) if _are_exchangeable(node.func, first, second):
            yield _with(node, args=[second, first, *others])
        case _:
            pass


def _are_exchangeable(called: ast.expr, first: ast.expr, second: ast.expr) -> bool:
    alike = type(first) is type(second) and ast.unparse(first) != ast.unparse(second)
    return alike and not ast.unparse(called).endswith(EITHER)


def _with(node: ast.expr, **fields: object) -> str:
    """Return `node` as text, with other `fields`."""
    changed = deepcopy(node)
    for name, value in fields.items():
        setattr(changed, name, value)
    return ast.unparse(changed)
