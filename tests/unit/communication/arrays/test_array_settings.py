"""The array form of a protocol uses all of its settings: none is accepted and ignored."""

from __future__ import annotations

import inspect
import re

from robochoc.communication.arrays.array_runs import _ARRAY_RUNS
from robochoc.protocols.protocol import Protocol
from tests.support.cases import looped


@looped("protocol", _ARRAY_RUNS)
def test_array_forms_use_all_settings(protocol: type[Protocol]) -> None:
    form = _ARRAY_RUNS[protocol]
    sources = "\n".join(inspect.getsource(base) for base in form.__mro__ if base.__module__.startswith("robochoc"))
    used = {*re.findall(r"settings\)?\.(\w+)", sources)}
    settings = {*protocol.settings.__struct_fields__}
    assert settings
    assert settings - used == set()
