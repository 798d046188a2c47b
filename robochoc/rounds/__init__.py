"""Teams whose robots choose values in synchronous rounds, for learning agents and for seats.

`team_rounds` computes the costs that each robot can know, and the cost of the team; `optimum` computes the best cost
once, to which answers are compared.
"""

from robochoc.rounds.optimum import Optimum, certified_optimum
from robochoc.rounds.team_rounds import TeamRounds

__all__ = ["Optimum", "TeamRounds", "certified_optimum"]
