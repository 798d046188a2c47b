"""Words of pyDCOP's command line, and the words of robochoc that replace them, for errors.

The page "Coming from pyDCOP" has the same words; `tests/docs/test_pydcop_words.py` compares them.
"""

from collections.abc import Mapping
from types import MappingProxyType

OPTIONS: Mapping[str, str] = MappingProxyType(
    {
        "--algo": "--protocol",
        "-a": "--protocol",
        "--algo_params": "--set",
        "-p": "--set",
        "--mode": "--runtime",
        "-m": "--runtime",
        "-t": "--timeout",
        "--output": "--json",
        "--collect_on": "--schedule cycles --journal FILE",
        "-c": "--schedule cycles --journal FILE",
        "--run_metric": "--schedule cycles --journal FILE",
    }
)
"""The options of `pydcop solve`."""

COMMANDS: Mapping[str, str] = MappingProxyType(
    {
        "run": "robochoc import PROBLEM SCENARIO -o TEAM, then robochoc solve TEAM",
        "orchestrator": "robochoc master",
        "agent": "robochoc robot",
        "batch": "robochoc experiment run",
        "consolidate": "robochoc experiment export",
        "graph": "robochoc export FILE --format dot",
        "distribute": "none: a robot owns its variables",
        "replica_dist": "none: no robot takes over the variables of a lost robot",
    }
)
"""The commands of pyDCOP with other names in robochoc, or `none` with a reason."""

PROTOCOLS: Mapping[str, str] = MappingProxyType(
    {
        "adsa": "a-dsa",
        "mixeddsa": "mixed-dsa",
        "amaxsum": "async-maxsum",
        "maxsum_dynamic": "s-dpop or dynabt",
        "dsatuto": "dsa",
        "dsa-tuto": "dsa",
    }
)
"""The algorithms of pyDCOP with other names in robochoc, or with the nearest protocol."""

SETTINGS: Mapping[str, str] = MappingProxyType({"stop_cycle": "cycles"})
"""The parameters of algorithms with other names in robochoc."""
