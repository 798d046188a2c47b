"""Secrets come from `Protocol.secret`: all robots know the seed of `Protocol.chance`, and can compute its numbers."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.problem import Team
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import Traits
from robochoc.run.purposes import PURPOSES
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.sniffer.recorded_messages import types_by_name
from robochoc.solver.agent_problem import RunParameters
from tests.support import golden
from tests.support.cases import cases
from tests.support.compiled import plain_python_only
from tests.support.program import ROOT

pytestmark = pytest.mark.usefixtures("quick_encryption")
MOST_MESSAGES = 1_000
QUICK = {"cycles": "1", "bits": "31"}
SETTINGS = {
    "p-dsa": (QUICK,),
    "p-maxsum": ({**QUICK, "preference": "0", "topology": "open"},),
    "p-mgm": (QUICK,),
    "pc-syncbb": ({"search": "open", "bits": "31"}, {"search": "hidden", "bits": "31"}),
}


def sources(protocol: type[Protocol], team: Team, settings: dict[str, str]) -> set[str]:
    """Return the names of the sources from which the robots draw in a run."""
    used = set[str]()

    def watched(name: str, draw: Callable[..., float]) -> Callable[..., float]:
        def number(*args: int) -> float:
            used.add(name)
            return draw(*args)

        return number

    with Simulation(team, protocol, RandomChannels(0), parameters=RunParameters(0, settings)) as simulation:
        for host in simulation._hosts.values():  # noqa: SLF001 - each robot has its own sources
            for name in ("chance", "secret"):
                setattr(host.protocol, name, watched(name, getattr(host.protocol, name)))
        simulation.search(messages=MOST_MESSAGES)
    return used


def hides_values(traits: Traits) -> bool:
    return traits.secret_keys or PURPOSES["privacy"].includes(traits)


def test_protocols_that_hide_values_draw_nothing_from_the_seed() -> None:
    """And `secret_keys` is declared exactly by the protocols that draw secrets."""
    with cases() as each:
        for name in protocol_names():
            protocol = protocol_named(name)
            for team in golden.fixed_teams(name).values() if hides_values(protocol.traits) else ():
                for settings in SETTINGS.get(name, ({},)):
                    with each(f"{name} {team.name} {settings}"):
                        expected = {"secret"} if protocol.traits.secret_keys else set()
                        assert sources(protocol, team, settings) == expected


def test_masked_fields_require_secret_keys() -> None:
    for name in protocol_names():
        masks = any(kind.masked for kind in types_by_name(protocol_named(name)).values())
        assert protocol_named(name).traits.secret_keys or not masks, name


@plain_python_only  # it reads the sources
def test_other_protocols_have_no_access_to_secrets() -> None:
    for name in protocol_names():
        protocol = protocol_named(name)
        modules = {one.__module__ for one in protocol.__mro__} - {Protocol.__module__}
        files = [ROOT / f"{module.replace('.', '/')}.py" for module in modules if module.startswith("robochoc.")]
        draws = any("self.secret" in file.read_text() for file in files)
        assert draws == protocol.traits.secret_keys, name
