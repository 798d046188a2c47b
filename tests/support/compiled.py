"""For tests that look at what only plain Python lets them see."""

from __future__ import annotations

import pytest

from robochoc.system.compiled_core import kind_of_core

plain_python_only = pytest.mark.skipif(
    kind_of_core() == "compiled core", reason="compiled code takes neither replaced methods nor values of other types"
)
