"""Functions in pyDCOP's files: Python syntax that is parsed by `ast` and interpreted here, and never executed.

`_Compiler` lists the allowed syntax. Any other syntax is refused by its name. Numbers are exact (`python_values`).
"""

from __future__ import annotations

import ast
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import NoReturn

from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.formats.dialects.pydcop.python_values import (
    AGGREGATES,
    ARITHMETIC,
    COMPARISONS,
    FUNCTIONS,
    MAX_ITEMS,
    SIGNS,
    BoundedDict,
    BoundedTuple,
    NoValueError,
    Value,
    bounded,
    distinct,
    items,
    literal,
    number,
    size_of,
)

MAX_LENGTH = 1_000_000
"""The maximum number of characters of a function."""
MAX_NODES = 50_000
"""The maximum number of operators and terms of a function."""
MAX_DEPTH = 300
"""The maximum depth of nesting of a function."""
MAX_STEPS = 5_000_000
"""The maximum number of steps of a function, for all arguments together.

Each pass of a loop counts, in proportion to the length of the loop's body, and so does each member of a list or text
that an operation reads.
"""
_NODES_A_STEP = 10
"""The number of operators and terms of a loop's body that count as one step."""

SourceFunction = Callable[..., Value]
"""A function called by its name."""

_Names = dict[str, Value]
_Closure = Callable[[_Names], Value]
_Statement = Callable[[_Names], "Value | _NoReturn"]


class _NoReturn:
    """The result of a statement that does not return."""


_CONTINUE = _NoReturn()


class PythonFunction:
    """A function of a problem's variables.

    Attributes:
        scope: The variables in the function, in order of appearance.
        body: The statements of the function; for an expression, a single statement.
    """

    def __init__(
        self,
        source: str,
        variables: Collection[str],
        fixed: Mapping[str, Value] = MappingProxyType({}),
        source_functions: Mapping[str, SourceFunction] = MappingProxyType({}),
    ) -> None:
        """Read a function as in pyDCOP: an expression, or statements with `return`.

        Args:
            source: The text.
            variables: The names of variables.
            fixed: The values of names that are constants.
            source_functions: Functions of a Python file, called `source.NAME` in the text. They are executed.

        Raises:
            MistakeError: if the text is not valid Python, is too long, or uses syntax that is not allowed.
        """
        self.body = _parsed(source)
        names = [node for node in _nodes(self.body) if isinstance(node, ast.Name)]
        stored = {node.id for node in names if isinstance(node.ctx, ast.Store)}
        loaded = [node.id for node in names]
        self.scope = tuple(dict.fromkeys(name for name in loaded if name in variables and name not in stored))
        # Only names that appear in the text: a problem has as many functions as variables.
        constants = {name: fixed[name] for name in loaded if name in fixed and name not in stored}
        compiler = _Compiler(variables, stored, constants, source_functions)
        self._compiler = compiler
        self._steps = _steps_of(self.body) // _NODES_A_STEP
        self._run: _Statement = (
            compiler.expression(self.body[0].value)
            if len(self.body) == 1 and isinstance(self.body[0], ast.Expr)
            else compiler.block(self.body)
        )

    def value(self, arguments: Mapping[str, Value]) -> Value:
        """Return the value of the function for `arguments`.

        Raises:
            MistakeError: if the function has no value, for example because of a division by zero.
        """
        try:
            self._compiler.step(self._steps)
            result = self._run(dict(arguments))
        except NoValueError as error:
            self._refuse(str(error), arguments)
        except (ArithmeticError, TypeError, LookupError, ValueError) as error:
            self._refuse(f"{type(error).__name__}: {error}", arguments)
        if isinstance(result, _NoReturn) or result is None:
            self._refuse("it returns nothing", arguments)
        return result

    def _refuse(self, why: str, arguments: Mapping[str, Value]) -> NoReturn:
        where = ", ".join(f"{name}={arguments[name]!s:.20}" for name in self.scope)
        what = f"the function has no value{f' at {where}' if where else ''}: {shortened(why)}"
        raise MistakeError(what, "write a function with a value for all values of its variables")


def _parsed(source: str) -> list[ast.stmt]:
    if len(source) > MAX_LENGTH:
        raise MistakeError("the function is too long", f"write at most {MAX_LENGTH} characters")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # warnings on the user's text, such as "\d" in a string
            body = ast.parse(source.lstrip()).body
    except SyntaxError as error:
        what = f"the function is not valid Python: {error.msg}, in line {error.lineno} of the function"
        raise MistakeError(what, "write an expression, or lines with a return") from None
    except (ValueError, RecursionError, MemoryError):
        what = "the function is not valid Python, or is nested too deeply"
        raise MistakeError(what, "write a shorter function") from None
    _check_size(body)
    returns = any(isinstance(node, ast.Return) for node in _nodes(body))
    if not returns and not (len(body) == 1 and isinstance(body[0], ast.Expr)):
        raise MistakeError("the function returns nothing", "write one expression, or lines with a return")
    return body


def _check_size(body: Sequence[ast.stmt]) -> None:
    waiting: list[tuple[ast.AST, int]] = [(one, 1) for one in body]
    count = 0
    while waiting:
        node, depth = waiting.pop()
        count += 1
        if count > MAX_NODES or depth > MAX_DEPTH:
            what = "nested too deeply" if depth > MAX_DEPTH else "too long"
            raise MistakeError(f"the function is {what}", "write a shorter function")
        waiting += [(child, depth + 1) for child in ast.iter_child_nodes(node)]


def _nodes(body: Sequence[ast.AST]) -> Iterator[ast.AST]:
    """Yield all nodes, in the order of the source text."""
    waiting = list(reversed(body))
    while waiting:
        node = waiting.pop()
        yield node
        waiting += reversed(list(ast.iter_child_nodes(node)))


class _Compiler:
    """Compiles syntax trees to closures. Each allowed kind of node has a case here."""

    def __init__(
        self,
        variables: Collection[str],
        stored: Collection[str],
        fixed: Mapping[str, Value],
        source_functions: Mapping[str, SourceFunction],
    ) -> None:
        self._variables = variables
        self._stored = stored
        self._fixed = fixed
        self._source_functions = source_functions
        self._steps = MAX_STEPS

    def block(self, body: Sequence[ast.stmt]) -> _Statement:
        """Return a closure that runs statements in order until one returns."""
        parts = [self._statement(one) for one in body]

        def run(names: _Names) -> Value | _NoReturn:
            for part in parts:
                result = part(names)
                if result is not _CONTINUE:
                    return result
            return _CONTINUE

        return run

    def _statement(self, node: ast.stmt) -> _Statement:  # noqa: PLR0911 - one for each kind of statement
        match node:
            case ast.Return(value=ast.expr() as value):
                return self.expression(value)
            case ast.Pass() | ast.Expr(value=ast.Constant()):
                return lambda _: _CONTINUE
            case ast.If(test=test, body=body, orelse=otherwise):
                condition, then, other = self.expression(test), self.block(body), self.block(otherwise)
                return lambda names: then(names) if condition(names) else other(names)
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                return _assignment(name, self.expression(value))
            case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value):
                return _assignment(name, self.expression(value))
            case ast.AugAssign(target=ast.Name(id=name), op=op, value=value):
                changed = ast.BinOp(ast.Name(name, ast.Load()), op, value)
                return _assignment(name, self.expression(ast.copy_location(changed, node)))
            case ast.For(target=ast.Name(id=name), iter=iterable, body=body, orelse=[]):
                return self._loop(name, self.expression(iterable), body)
            case _:
                pass
        return _refuse(node)

    def _loop(self, name: str, iterable: _Closure, statements: Sequence[ast.stmt]) -> _Statement:
        body, steps = self.block(statements), _steps_of(statements)

        def run(names: _Names) -> Value | _NoReturn:
            for one in self._items(iterable(names)):
                self.step(steps)
                names[name] = one
                result = body(names)
                if result is not _CONTINUE:
                    return result
            return _CONTINUE

        return run

    def expression(self, node: ast.expr) -> _Closure:  # noqa: C901, PLR0911, PLR0912 - one case for each kind of node
        """Return a closure that computes an expression."""
        match node:
            case ast.Constant(value=value):
                return self._constant(node, value)
            case ast.Name(id=name):
                return self._name(name)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in ARITHMETIC:
                return _binary(ARITHMETIC[type(op)], self.expression(left), self.expression(right))
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                denied = self.expression(operand)
                return lambda names: not denied(names)
            case ast.UnaryOp(op=op, operand=operand) if type(op) in SIGNS:
                sign, signed = SIGNS[type(op)], self.expression(operand)
                return lambda names: sign(number(signed(names)))
            case ast.BoolOp(op=op, values=values):
                return _short_circuit([self.expression(one) for one in values], is_and=isinstance(op, ast.And))
            case ast.Compare(left=left, ops=ops, comparators=others):
                return self._compile_comparison(left, ops, others)
            case ast.IfExp(test=test, body=body, orelse=otherwise):
                condition, then, other = map(self.expression, (test, body, otherwise))
                return lambda names: then(names) if condition(names) else other(names)
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return self._call(name, FUNCTIONS, arguments)
            case ast.Call(func=ast.Attribute(value=ast.Name(id="source"), attr=name), args=arguments, keywords=[]) if (
                self._source_functions
            ):
                return self._call(name, self._source_functions, arguments)
            case ast.Tuple(elts=parts) | ast.List(elts=parts):
                compiled = [self.expression(one) for one in parts]
                return lambda names: BoundedTuple([one(names) for one in compiled])
            case ast.Dict(keys=keys, values=values) if None not in keys:
                return _entries([self.expression(key) for key in keys if key], [*map(self.expression, values)])
            case ast.Subscript(value=value, slice=index) if not isinstance(index, ast.Slice):
                holder, place = self.expression(value), self.expression(index)
                return lambda names: self._item(holder(names), place(names))
            case ast.GeneratorExp(elt=part, generators=[loop]) | ast.ListComp(elt=part, generators=[loop]):
                return self._comprehension(part, loop)
            case _:
                pass
        return _refuse(node)

    def _constant(self, node: ast.expr, value: object) -> _Closure:
        try:
            constant = literal(value)
        except NoValueError:
            _refuse(node)
        return lambda _: constant

    def _name(self, name: str) -> _Closure:
        if name in self._fixed:
            value = self._fixed[name]
            return lambda _: value
        if name not in self._variables and name not in self._stored:
            if name in FUNCTIONS:
                raise MistakeError(f"the function '{name}' is used as a value", "call it: write its arguments")
            hint = suggestion(name, sorted({*self._variables, *self._stored}), "variables")
            raise MistakeError(f"the function contains '{shortened(name)}', which is not a variable", hint)
        return lambda names: names[name]

    def _call(self, name: str, functions: Mapping[str, SourceFunction], arguments: Sequence[ast.expr]) -> _Closure:
        called = functions.get(name)
        if called is None:
            what = f"the function calls '{shortened(name)}', which is not allowed"
            raise MistakeError(what, f"use only {shortened(' '.join(functions))}")
        if any(isinstance(one, ast.Starred) for one in arguments):
            _refuse(arguments[0])
        read = self._members if name in AGGREGATES and len(arguments) == 1 else self.expression
        compiled = [read(one) for one in arguments]

        def call(names: _Names) -> Value:
            values = [one(names) for one in compiled]
            self.step(sum(map(size_of, values)))
            result = bounded(called(*values))
            self.step(size_of(result))
            return result

        return call

    def _members(self, node: ast.expr) -> _Closure:
        """Return an expression of which only the members are used. It may be a set, with each member once."""
        if not isinstance(node, ast.Set):
            return self.expression(node)
        compiled = [self.expression(one) for one in node.elts]

        def members(names: _Names) -> Value:
            return distinct([one(names) for one in compiled])

        return members

    def _compile_comparison(self, left: ast.expr, ops: Sequence[ast.cmpop], others: Sequence[ast.expr]) -> _Closure:
        first = self.expression(left)
        rest = [
            (COMPARISONS[type(op)], (self._members if isinstance(op, ast.In | ast.NotIn) else self.expression)(other))
            for op, other in zip(ops, others, strict=True)
        ]

        def compare(names: _Names) -> Value:
            before = first(names)
            for holds, other in rest:
                after = other(names)
                self.step(size_of(before) + size_of(after))
                if not holds(before, after):
                    return False
                before = after
            return True

        return compare

    def _comprehension(self, part: ast.expr, loop: ast.comprehension) -> _Closure:
        if not isinstance(loop.target, ast.Name) or loop.is_async:
            _refuse(loop.target)
        name, iterable, compiled = loop.target.id, self.expression(loop.iter), self.expression(part)
        conditions = [self.expression(one) for one in loop.ifs]
        steps = _steps_of([part, *loop.ifs])

        def collect(names: _Names) -> Value:
            self.step(len(names) // _NODES_A_STEP)
            inner = dict(names)
            found: list[Value] = []
            size = 0
            for one in self._items(iterable(names)):
                self.step(steps)
                inner[name] = one
                if all(condition(inner) for condition in conditions):
                    found.append(compiled(inner))
                    size += max(1, size_of(found[-1]))
                    if size > MAX_ITEMS:
                        break
            return BoundedTuple(found)

        return collect

    def _items(self, value: Value) -> tuple[Value, ...]:
        self.step(0 if isinstance(value, tuple) else size_of(value))
        return items(value)

    def _item(self, holder: Value, place: Value) -> Value:
        if isinstance(holder, dict):
            self.step(size_of(place))
            return holder[place]
        if isinstance(holder, (tuple, str)) and isinstance(place, int):
            return holder[place]
        raise NoValueError("only lists, texts and dictionaries have items")

    def step(self, number: int) -> None:
        """Count steps. Raises `NoValueError` if there are too many."""
        self._steps -= number
        if self._steps < 0:
            raise NoValueError(f"it requires more than {MAX_STEPS:,} steps")


def _steps_of(body: Sequence[ast.AST]) -> int:
    """Return the number of steps of a loop's body, without the steps of inner loops."""
    return 1 + sum(isinstance(node, ast.expr | ast.stmt) for node in _nodes(body)) // _NODES_A_STEP


def _entries(keys: Sequence[_Closure], values: Sequence[_Closure]) -> _Closure:
    def entries(names: _Names) -> Value:
        found = [key(names) for key in keys]
        distinct(found)
        return BoundedDict(dict(zip(found, [one(names) for one in values], strict=True)))

    return entries


def _assignment(name: str, value: _Closure) -> _Statement:
    def assign(names: _Names) -> _NoReturn:
        names[name] = value(names)
        return _CONTINUE

    return assign


def _binary(meaning: Callable[..., Value], left: _Closure, right: _Closure) -> _Closure:
    return lambda names: bounded(meaning(number(left(names)), number(right(names))))


def _short_circuit(parts: Sequence[_Closure], *, is_and: bool) -> _Closure:
    """Return the value of `and` or `or`: the first value that decides the result, or the last value."""

    def decide(names: _Names) -> Value:
        value: Value = None
        for part in parts:
            value = part(names)
            if bool(value) != is_and:
                return value
        return value

    return decide


def _refuse(node: ast.AST) -> NoReturn:
    what = type(node).__name__
    match node:
        case ast.Attribute(attr=attribute) | ast.Call(func=ast.Attribute(attr=attribute)):
            what = f"the attribute '.{shortened(attribute)}'"
        case ast.Import() | ast.ImportFrom():
            what = "an import"
        case ast.Call():
            what = "a call of this form"
        case _:
            pass
    line = getattr(node, "lineno", 1)
    hint = "use arithmetic, comparisons, conditions, lists, loops over lists, and the documented functions"
    raise MistakeError(f"line {line} of the function contains {what}, which is not allowed", hint)
