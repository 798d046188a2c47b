"""robochoc: teams of robots that solve constraint problems together.

`load(path).solve()` on this machine, `AgentsContainer` on several (`robochoc/api.py`); both come when they are asked
for, so that the command line starts quickly.
"""

from __future__ import annotations

TYPE_CHECKING = False  # that of `typing` takes longer to import than all else before signals are heard (cli/main.py)
if TYPE_CHECKING:
    from robochoc.api import AgentsContainer, Problem, load
    from robochoc.model.outcome import Outcome, Verdict

__all__ = ["AgentsContainer", "Outcome", "Problem", "Verdict", "__version__", "load"]

__version__ = "0.1.0"


def __getattr__(name: str) -> object:
    if name in {"AgentsContainer", "Problem", "load"}:
        from robochoc import api  # noqa: PLC0415 - see above

        return getattr(api, name)
    if name in {"Outcome", "Verdict"}:
        from robochoc.model import outcome  # noqa: PLC0415 - see above

        return getattr(outcome, name)
    raise AttributeError(f"module 'robochoc' has no attribute {name!r}")
