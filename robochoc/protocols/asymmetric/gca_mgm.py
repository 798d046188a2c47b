"""Guaranteed Convergence Asymmetric MGM (GCA-MGM).

MCS-MGM in which a robot hands over its entry whenever a neighbour's move has increased its costs at all. From then on a
robot pays the entries that it has received, so fewer and fewer moves seem better than they are, and the robots stop
moving.

- **When to use**: asymmetric costs, if convergence is required.
- **Guarantees**: incomplete; it converges, and stops after `cycles` cycles, without a proof of optimality. P_ij + P_ji,
  the total cost of both sides of a pair, never changes.
- **Parameters (`--set`)**: `cycles` (default 100).
- **Reference**: Grinshpoun, Grubshtein, Zivan, Netzer, Meisels: "Asymmetric distributed constraint optimization
  problems", JAIR 47, 2013 (GCA-MGM).

For the choices see `mcs_mgm.py`. More entries are disclosed than in MCS-MGM.

>>> from robochoc.communication.simulator.schedule import Concurrent
>>> from robochoc.communication.simulator.simulator import Simulation
>>> from robochoc.generators.random_csp import random_csp
>>> team = random_csp(5, 3, 0.6, 0, max_cost=9, asymmetric=True)
>>> result = Simulation(team, GCAMGM, Concurrent(seed=0)).search()
>>> result.metrics.messages
{'Gain': 1200, 'Transfer': 1200, 'Value': 1200}
"""

from __future__ import annotations

from dataclasses import replace

from robochoc.protocols.asymmetric.mcs_mgm import MCSMGM
from robochoc.protocols.shared.cycles import NO_GAIN
from robochoc.solver.local_problem import LexicographicCost


class GCAMGM(MCSMGM):
    """One agent of GCA-MGM."""

    traits = replace(MCSMGM.traits, use_when="asymmetric costs, and robots have to come to rest")

    def too_much(self, loss: LexicographicCost, gained: LexicographicCost) -> bool:  # noqa: ARG002 - any loss is
        """Return whether a neighbour's move has cost this robot anything."""
        return loss > NO_GAIN
