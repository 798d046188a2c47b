"""Lazy data classes behave like those of `dataclasses`."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
import sys
from collections.abc import Callable
from dataclasses import KW_ONLY, FrozenInstanceError, field
from importlib import import_module
from typing import Any, ClassVar, get_type_hints

import pytest

from robochoc.model.constraint import Domain
from robochoc.system.lazy_dataclass import dataclass

Calls = list[tuple[tuple[Any, ...], dict[str, Any]]]
"""Arguments of constructors."""


def classes(decorator: Callable[..., Any]) -> list[Any]:
    """Return classes with fields of all kinds, made by a decorator."""

    @decorator(frozen=True)
    class Point:
        x: int
        y: int = 2
        tags: list[str] = field(default_factory=list, compare=False)
        norm: int = field(init=False, repr=False, default=0)
        seen: dict[str, int] = field(init=False, default_factory=dict, hash=False)

        def __post_init__(self) -> None:
            object.__setattr__(self, "norm", self.x + self.y)

    @decorator(frozen=True)
    class Named(Point):
        _: KW_ONLY
        y: int = 5
        name: str = field(default="none", repr=False)

    @decorator(frozen=True, kw_only=True, repr=False)
    class Options:  # noqa: PLW1641 - made by the decorator
        common: ClassVar[int] = 3
        left: int = 1
        right: int

        def __eq__(self, other: object) -> bool:
            return isinstance(other, Options) and self.left == other.left

    @decorator(frozen=True, eq=False)
    class Empty:
        def __repr__(self) -> str:
            return "empty"

    return [Point, Named, Options, Empty]


ARGUMENTS: list[Calls] = [
    [((1,), {}), ((1, 2), {}), ((1, 3, ["a"]), {}), ((), {"x": 1, "tags": ["b"]}), ((), {}), ((1, 2, [], 4), {})],
    [((1,), {}), ((1,), {"name": "n"}), ((1, 7), {"name": "n"}), ((1,), {"y": 2}), ((), {"name": "n"})],
    [((), {"right": 1}), ((), {"left": 2, "right": 3}), ((), {"left": 2, "right": 4}), ((1,), {}), ((), {"up": 1})],
    [((), {}), ((1,), {})],
]


def observed(cls: Any, others: Calls, first: str) -> list[Any]:  # noqa: ANN401 - a data class
    """Return what instances show, with the use of `first` before other uses."""
    getattr(cls, first, None)
    shown: list[Any] = []
    made = []
    for positional, named in others:
        try:
            made.append(cls(*positional, **named))
        except TypeError as error:
            shown.append(str(error))
    shown += [cls.__match_args__, [str(one) for one in dataclasses.fields(cls)]]
    shown += [str(cls.__dataclass_params__), str(inspect.signature(cls)), dataclasses.is_dataclass(cls)]
    for one in made:
        # An identity differs from run to run, as do the hashes and texts that are derived from it.
        own_text, own_hash = (getattr(cls, name) is getattr(object, name) for name in ("__repr__", "__hash__"))
        shown += [own_text or repr(one), own_hash or hash(one), [one == other for other in made], vars(one)]
        shown += [own_hash or copy.deepcopy(one) == one, own_text or repr(dataclasses.replace(one))]
        for change, words in ((setattr, ("x", 1)), (delattr, ("other",))):
            with pytest.raises(FrozenInstanceError) as raised:
                change(one, *words)
            shown.append(str(raised.value))
    return shown


@pytest.mark.parametrize(
    "first", ["__init__", "__eq__", "__hash__", "__repr__", "__match_args__", "__dataclass_params__"]
)
def test_behaves_like_dataclasses(first: str) -> None:
    for ours, theirs, arguments in zip(classes(dataclass), classes(dataclasses.dataclass), ARGUMENTS, strict=True):
        assert observed(ours, arguments, first) == observed(theirs, arguments, first)


def test_instances_can_be_pickled() -> None:
    domain = Domain("D", (range(1, 3),))
    assert pickle.loads(pickle.dumps(domain)) == domain  # noqa: S301 - ours


def test_signatures_of_robochoc_are_those_of_dataclasses() -> None:
    import_module("robochoc.run.orchestrator")
    for module in [module for name, module in sys.modules.items() if name.startswith("robochoc.")]:
        for cls in [cls for cls in vars(module).values() if isinstance(cls, type) and dataclasses.is_dataclass(cls)]:
            if cls.__dataclass_params__.init:  # type: ignore[attr-defined]
                fields = [(one.name, one.type, one) for one in dataclasses.fields(cls)]
                theirs = dataclasses.make_dataclass("Theirs", fields, frozen=True)
                assert str(inspect.signature(cls)) == str(inspect.signature(theirs)), cls


def test_methods_of_subclasses_call_those_of_lazy_base_classes() -> None:
    @dataclass(frozen=True)
    class Base:
        x: int
        domain: Domain | None = None

    class Child(Base):
        def __init__(self, word: str) -> None:
            super().__init__(len(word))

        def __eq__(self, other: object) -> bool:
            return super().__eq__(other)

        def __hash__(self) -> int:
            return super().__hash__() + 1

        def __repr__(self) -> str:
            return super().__repr__() + "!"

    assert (repr(Child("abc")).count("!"), Child("abc")) == (1, Child("abc"))
    assert [hash(Child("abc")) - hash(Base(3)) for _ in range(2)] == [1, 1]


def test_annotations_of_constructors_can_be_resolved() -> None:
    assert get_type_hints(Domain.__init__)["name"] is str
    signature = inspect.signature(Domain, eval_str=True)
    assert signature.parameters["name"].annotation is str


@pytest.mark.skipif(sys.version_info < (3, 13), reason="copy.replace was added in Python 3.13")
def test_instances_can_be_copied_with_changes() -> None:
    assert copy.replace(Domain("D", (range(1, 3),)), name="E").name == "E"  # type: ignore[attr-defined]
