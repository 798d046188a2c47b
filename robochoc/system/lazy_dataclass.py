"""`dataclass`, as in `dataclasses`, but methods of frozen classes are compiled on first use, so commands start quickly.

`dataclasses` compiles six methods of each frozen class when the class is defined; a small run calls a tenth of them.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Sequence
from dataclasses import MISSING, Field, FrozenInstanceError
from types import FunctionType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass  # noqa: PLC0414 - so that mypy treats it as the original
else:

    def dataclass(cls=None, /, **options):  # noqa: ANN001, ANN003, ANN201 - typed above
        """Make a class a data class. Classes that are not frozen or have slots are left to `dataclasses`."""
        if cls is None:
            return lambda decorated: dataclass(decorated, **options)
        if not options.get("frozen") or not options.keys() <= {"frozen", "init", "repr", "eq", "kw_only"}:
            return dataclasses.dataclass(cls, **options)
        _make_lazy(cls, options)
        return cls


_METHODS = {"__init__": "init", "__repr__": "repr", "__eq__": "eq", "__hash__": "eq"}
_ATTRIBUTES = ("__dataclass_fields__", "__dataclass_params__", "__match_args__")
_NOTHING = {"frozen": False, "init": False, "repr": False, "eq": False}
_ALONE = {"__repr__": {"repr": True}, "__eq__": {"eq": True}, "__hash__": {"unsafe_hash": True}}
_SET, _UNSET = "_dataclass_set", "_dataclass_unset"
"""Names in a compiled `__init__`, which must differ from the fields'."""


@dataclasses.dataclass
class _NoFields:
    """A base that is not frozen."""


class _Unset:
    def __repr__(self) -> str:
        return "<factory>"


class _OnFirstUse:
    """An attribute of a data class that replaces itself on first use."""

    def __init__(self, cls: Any, name: str, body: dict[str, Any], options: dict[str, bool]) -> None:  # noqa: ANN401
        self._cls, self._name, self._body, self._options = cls, name, body, options

    def __get__(self, instance: object, owner: type) -> object:
        made = self._init() if self._name == "__init__" else self._by_dataclasses()
        setattr(self._cls, self._name, made)
        # `super().__init__` must return this method, although the subclass overrides it.
        return made.__get__(instance, owner) if isinstance(made, FunctionType) else made

    def _by_dataclasses(self) -> Any:  # noqa: ANN401 - a method or an attribute
        """Let `dataclasses` work on a class with the same fields and no methods."""
        name, options = self._cls.__name__, self._options | _NOTHING | _ALONE.get(self._name, {})
        bases = [base.__dataclass_fields__ for base in self._cls.__bases__ if hasattr(base, "__dataclass_fields__")]
        twin = type(name, tuple(type(name, (_NoFields,), {"__dataclass_fields__": one}) for one in bases), self._body)
        if self._name == "__dataclass_params__":
            twin, options = type(name, (), {"__doc__": name}), self._options
        return vars(dataclasses.dataclass(twin, **options))[self._name]

    def _fields(self) -> Sequence[Field[Any]]:
        """Return the fields like `dataclasses`, which would search each annotation for its markers three times."""
        own: dict[str, str] = self._body.get("__annotations__", {})
        marked = any(mark in str(text) for text in own.values() for mark in ("ClassVar", "InitVar", "KW_ONLY"))
        if marked or any(hasattr(base, "__dataclass_fields__") for base in self._cls.__bases__):
            return dataclasses.fields(self._cls)
        found = []
        for name, text in own.items():
            value = self._body.get(name, MISSING)
            one: Field[Any] = value if isinstance(value, Field) else dataclasses.field(default=value)
            one.name, one.type = name, text
            if one.kw_only is MISSING:
                one.kw_only = self._options.get("kw_only", False)
            found.append(one)
        return found

    def _init(self) -> Any:  # noqa: ANN401 - a function
        """Compile `__init__`. `dataclasses` would compile two further methods with it."""
        fields = self._fields()
        space = {**vars(sys.modules[self._cls.__module__]), _SET: object.__setattr__, _UNSET: _Unset()}
        lines, parameters = [], ["self"]
        for field in fields:
            value = field.name
            if field.default_factory is not MISSING:
                space[f"{_SET}_{value}"] = field.default_factory
                made = f"{_SET}_{value}()"
                value = f"{made} if {value} is {_UNSET} else {value}" if field.init else made
            elif not field.init:
                continue
            lines.append(f" {_SET}(self, {field.name!r}, {value})\n")
        for field in sorted((field for field in fields if field.init), key=lambda field: bool(field.kw_only)):
            if field.kw_only and "*" not in parameters:
                parameters.append("*")
            default = ""
            if field.default_factory is not MISSING:
                default = f"={_UNSET}"
            elif field.default is not MISSING:
                space[f"{_UNSET}_{field.name}"] = field.default
                default = f"={_UNSET}_{field.name}"
            parameters.append(field.name + default)
        if hasattr(self._cls, "__post_init__"):
            lines.append(" self.__post_init__()\n")
        exec(f"def __init__({', '.join(parameters)}):\n{''.join(lines) or ' pass'}", space)  # noqa: S102 - our names
        made = space["__init__"]
        made.__qualname__ = f"{self._cls.__qualname__}.__init__"
        made.__annotations__ = {**{field.name: field.type for field in fields if field.init}, "return": None}
        return made


def _make_lazy(cls: Any, options: dict[str, bool]) -> None:  # noqa: ANN401 - any class
    own = vars(cls)
    names = ["__module__", "__qualname__", "__annotations__", *own.get("__annotations__", ())]
    body = {"__doc__": cls.__name__} | {name: own[name] for name in names if name in own}
    for name, value in body.items():
        if isinstance(value, Field):
            if value.default is MISSING:
                delattr(cls, name)
            else:
                setattr(cls, name, value.default)
    wanted = [name for name, option in _METHODS.items() if options.get(option, True) and own.get(name) is None]
    for name in (*wanted, *_ATTRIBUTES):
        setattr(cls, name, _OnFirstUse(cls, name, body, options))

    def set_attribute(self: object, name: str, value: object) -> None:
        if type(self) is cls or name in cls.__dataclass_fields__:
            raise FrozenInstanceError(f"cannot assign to field {name!r}")
        super(cls, self).__setattr__(name, value)

    def delete_attribute(self: object, name: str) -> None:
        if type(self) is cls or name in cls.__dataclass_fields__:
            raise FrozenInstanceError(f"cannot delete field {name!r}")
        super(cls, self).__delattr__(name)

    cls.__setattr__, cls.__delattr__ = set_attribute, delete_attribute
    if sys.version_info >= (3, 13) and "__replace__" not in own:
        cls.__replace__ = dataclasses._replace  # for `copy.replace`
