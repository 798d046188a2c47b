"""All mutants of a file: its text, changed in one place, such as `<` for `<=`, or with a statement left out.

What has no effect on a run is left alone: annotations, `assert`, `case never`, and how messages are called (`Act`,
`in_words`).
"""

from __future__ import annotations

import ast
import difflib
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass

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
LEFT_OUT = (ast.AugAssign, ast.Delete, ast.Raise, ast.Continue, ast.Break)
NOTHING = ("None", "False", "''", "()")
"""What a `return` might as well not return."""
SKIPPED = ("annotation", "returns", "decorator_list")


@dataclass(frozen=True)
class Mutant:
    """The text of a file with one change: the bytes from `start` to `end` replaced by `new`."""

    path: str
    number: int
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
    changes = []
    for node, new in _changes(ast.parse(source)):
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        start, end = starts[node.lineno - 1] + node.col_offset, starts[node.end_lineno - 1] + node.end_col_offset
        changes.append((start, end, new))
    return [Mutant(path, number, source, *change) for number, change in enumerate(sorted(set(changes)))]


def _changes(node: ast.AST) -> Iterator[tuple[ast.expr | ast.stmt, str]]:
    """Yield expressions and statements below `node`, each with what could stand in its place."""
    if isinstance(node, ast.Assert) or (isinstance(node, ast.FunctionDef) and node.name == "in_words"):
        return
    if isinstance(node, ast.match_case) and ast.unparse(node.pattern) == "never":
        return
    if isinstance(node, ast.Call) and ast.unparse(node.func) == "Act":
        return
    if isinstance(node, ast.stmt):
        yield from ((node, new) for new in _statements(node))
    elif isinstance(node, ast.expr):
        yield from ((node, f"({new})") for new in _expressions(node))
    for name, child in ast.iter_fields(node):
        if name not in SKIPPED and not (isinstance(node, ast.ClassDef) and name == "keywords"):
            for part in child if isinstance(child, list) else [child]:
                if isinstance(part, ast.AST):
                    yield from _changes(part)


def _statements(node: ast.stmt) -> Iterator[str]:
    stored = isinstance(node, ast.Assign) and not any(isinstance(target, ast.Name) for target in node.targets)
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
        case ast.Constant(value=int(value)):
            yield str(value + 1)
        case ast.IfExp(test=test, body=body, orelse=orelse):
            yield _with(node, test=test, body=orelse, orelse=body)
        case ast.Call(func=ast.Name(id=name)) if name in CALLED:
            yield _with(node, func=ast.Name(CALLED[name]))
        case ast.Call(args=[first, second, *others]) if ast.unparse(first) != ast.unparse(second):
            yield _with(node, args=[second, first, *others])
        case _:
            pass


def _with(node: ast.expr, **fields: object) -> str:
    """Return `node` as text, with other `fields`."""
    changed = deepcopy(node)
    for name, value in fields.items():
        setattr(changed, name, value)
    return ast.unparse(changed)
