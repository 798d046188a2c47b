"""The former place of `robochoc.protocols.acts`, for protocols of users that import it from here."""

from __future__ import annotations

from importlib import import_module
from typing import Any


def __getattr__(name: str) -> Any:  # noqa: ANN401 - classes and functions
    return getattr(import_module("robochoc.protocols.acts"), name)
