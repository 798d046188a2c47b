"""Every exception of the package reaches another process as it was raised."""

from __future__ import annotations

import copy
import importlib
import inspect
import pickle
import re
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pytest
from lxml import etree

import robochoc
from robochoc.app.sketch.troubles import About, Trouble
from robochoc.communication.network.control_messages import StandbyAnswer
from robochoc.communication.search_result import RobotsLostError
from robochoc.formats.diagnostics import Diagnostic, InvalidInputError
from robochoc.modelling.errors import ModelError, SourceLine, UnknownNameError
from robochoc.run.networked.address import Address
from robochoc.run.registry import UnknownProtocolError
from robochoc.services.descriptions import Reason

ARGUMENTS: dict[str, object] = {
    "str": "a word",
    "int": 3,
    "int | None": 3,
    "float": 2.5,
    "bool": True,
    "object": ("a value", 1),
    "Sequence[str]": ["a", "b"],
    "Iterable[str]": ("a", "b"),
    "Sequence[int]": [4, 5],
    "Mapping[str, str]": {"a": "process ended", "b": "no answer"},
    "Iterable[Diagnostic]": [Diagnostic("a.xml", 3, "wrong", "do this"), Diagnostic("a.xml", 1, "odd", "")],
    "Address": Address("a.example", 7447),
    "StandbyAnswer": StandbyAnswer({}, (), over="solution"),
    "SourceLine | None": SourceLine("a.py", 7),
    "tuple[int, ...] | None": (1, 0),
    "etree._Element": etree.fromstring("<a><b c='1'>text</b></a>"),
    "Reason": next(iter(Reason)),
    "Trouble": Trouble(About.RULE, "1", "trouble.no-robots"),
    "Literal['start', 'goal']": "goal",
}
"""An argument for each annotation of a parameter of the constructors."""


def exceptions() -> Iterator[type[BaseException]]:
    """Yield the exception classes in modules in which one has a constructor: others are copied by their message."""
    header = r"^class (\w*Error|\w*Exception|\w+(?=\(.*(?:Error|Exception|Exit|Interrupt)\)))\(.*\n"
    declared = re.compile(header + r"(?:(?: .*)?\n)*? +def __init__", re.MULTILINE)
    sources = Path(robochoc.__file__).parent
    for path in sorted(sources.rglob("*.py")):
        if declared.search(path.read_text()):
            name = ".".join(path.relative_to(sources.parent).with_suffix("").parts).removesuffix(".__init__")
            for value in vars(importlib.import_module(name)).values():
                if isinstance(value, type) and issubclass(value, BaseException) and value.__module__ == name:
                    yield value


def example(kind: type[BaseException]) -> BaseException:
    """Return an exception of a class, constructed from one argument for each parameter."""
    if "__init__" not in {
        name for base in kind.__mro__ if base.__module__.startswith("robochoc") for name in vars(base)
    }:
        return kind("a message")
    positional: list[Any] = []
    named: dict[str, Any] = {}
    for one in list(inspect.signature(kind).parameters.values()):
        argument = ARGUMENTS[str(one.annotation)]
        if one.kind in {one.VAR_POSITIONAL, one.POSITIONAL_OR_KEYWORD}:
            positional.append(argument)
        elif one.kind == one.KEYWORD_ONLY:
            named[one.name] = argument
    return kind(*positional, **named)


def shown(error: Any) -> tuple[object, ...]:  # noqa: ANN401 - it is compared
    """Return the message, the arguments and the attributes of an exception, in a form that can be compared."""
    fields = {name: etree.tostring(one) if name == "tree" else one for name, one in vars(error).items()}
    return type(error), str(error), error.args, fields


def sent(error: BaseException) -> object:
    """Return an exception as another process receives it."""
    return pickle.loads(pickle.dumps(error))  # noqa: S301 - this test's own bytes


def test_every_exception_survives_a_copy() -> None:
    kinds = list(exceptions())
    assert {ModelError, InvalidInputError, RobotsLostError} <= set(kinds)
    for kind in kinds:
        error = example(kind)
        error.add_note("a note")
        for copied in (sent(error), copy.copy(error)):
            assert shown(copied) == shown(error), kind


def test_errors_of_the_api_survive_a_copy() -> None:
    model = robochoc.Model("m")
    model.robot("a").variable("x", [0])
    jobs: list[tuple[type[Exception], Callable[[], object]]] = [
        (InvalidInputError, lambda: robochoc.load("/nonexistent")),
        (ModelError, lambda: model.robot("not a name")),
        (UnknownNameError, lambda: model["x"]),
        (UnknownProtocolError, lambda: model.solve("nonsense")),
    ]
    for kind, job in jobs:
        with pytest.raises(kind) as raised:
            job()
        assert shown(sent(raised.value)) == shown(raised.value)


def test_an_error_in_a_worker_leaves_its_pool_intact() -> None:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        failed = pool.submit(robochoc.load, "/nonexistent")
        assert isinstance(failed.exception(), InvalidInputError)
        assert pool.submit(abs, -1).result() == 1
