"""A team in several blocks runs as in one: the values of every cycle, costs, and counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robochoc.communication.arrays.array_runs import array_run_for
from robochoc.communication.arrays.blocks import BlockReport, Limits, RunBlock, joined, split_team
from robochoc.communication.arrays.cycle_run import cycles_of
from robochoc.communication.arrays.description import Description, describe_team
from robochoc.communication.arrays.layout import ArrayLayout
from robochoc.communication.session import Epoch
from robochoc.protocols.settings import read_settings
from robochoc.protocols.shared.cycles import CycleProtocol
from robochoc.run.registry import protocol_named
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compile import Compiler
from robochoc.solver.compiled_team import CompiledTeam
from tests.support.array_teams import COUNTS, MAKERS, random_settings
from tests.support.block_threads import run_in_threads
from tests.support.examples import count, drawn

PROTOCOLS = ("dsa", "mgm", "maxsum")


def compare(
    description: Description, protocol: str, settings: dict[str, str], seed: int, many: int, limits: Limits
) -> None:
    """Compare a run in up to `many` blocks with one in one block, and with one without blocks."""
    kind = protocol_named(protocol)
    assert issubclass(kind, CycleProtocol)
    chosen = read_settings(kind, settings)
    assert isinstance(chosen, type(kind.settings))
    form = array_run_for(kind)
    run = RunBlock(form, chosen, seed, limits, changes=True)

    one, several = (
        joined(run_in_threads(split_team(description, blocks, functions=form.functions_in_blocks), run))
        for blocks in (1, many)
    )
    assert_same(one, several)
    if one.is_over:
        whole = form(ArrayLayout(description), chosen, seed)
        assert list(cycles_of(whole))[-1].costs == several.costs
        assert whole.metrics(0) == replace(several.metrics, wall_s=0)


def assert_same(whole: BlockReport, blocks: BlockReport) -> None:
    assert (whole.verdict, whole.witness) == (blocks.verdict, blocks.witness)
    assert (whole.costs, whole.cycle, whole.is_over) == (blocks.costs, blocks.cycle, blocks.is_over)
    for name in COUNTS:
        assert getattr(whole.metrics, name) == getattr(blocks.metrics, name), name
    for name in ("values", "best"):
        assert by_robot(whole.robots, getattr(whole, name)) == by_robot(blocks.robots, getattr(blocks, name))
    assert whole.changes is not None
    assert blocks.changes is not None
    assert [by_robot(*one) for one in whole.changes] == [by_robot(*one) for one in blocks.changes]


def by_robot(robots: np.ndarray, values: np.ndarray) -> dict[int, int]:
    return dict(zip(robots.tolist(), values.tolist(), strict=True))


@pytest.mark.parametrize("protocol", PROTOCOLS)
@count("many", 25, 2000)
def test_random_teams_in_blocks_run_as_in_one(protocol: str, many: int) -> None:
    with Compiler() as compiler:
        for seed in range(many):
            chance = drawn(f"blocks {protocol} {seed}")
            team = CompiledTeam(chance.choice(MAKERS)(chance), lambda robot: compiler.compile(robot).domain)
            start = {n: chance.choice([*v.domain]) for n, v in team.team.variables.items() if chance.random() < 0.3}
            parts = Epoch(team, parameters=RunParameters(seed, start=start)).parts(protocol_named(protocol))
            limits = Limits(messages=chance.randint(1, 60)) if chance.random() < 0.2 else Limits()
            settings = random_settings(protocol, chance)
            compare(describe_team(parts), protocol, settings, seed, chance.randint(2, 4), limits)
