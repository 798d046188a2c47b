"""Modules that are imported once something of them is used: heavy ones, which few tests need."""

from __future__ import annotations

import importlib
from typing import Any


class LazyModule:
    """Stands for a module until the first attribute is read."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, attribute: str) -> Any:  # noqa: ANN401 - whatever is in the module
        if attribute.startswith("_"):  # pytest asks each object of a test module for names of its own
            raise AttributeError(attribute)
        return getattr(importlib.import_module(self._name), attribute)
