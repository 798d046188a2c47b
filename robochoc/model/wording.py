"""The former place of `robochoc.protocols.wording`, for protocols of users that import it from here."""

from __future__ import annotations

from importlib import import_module
from typing import Any


def __getattr__(name: str) -> Any:  # noqa: ANN401 - classes and functions
    module = "system.plain_text" if name in {"counted", "listed"} else "protocols.wording"
    return getattr(import_module(f"robochoc.{module}"), name)
