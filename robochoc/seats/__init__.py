"""Games in rounds: robots of a team are played by outside programs, protocols and baselines (`robochoc play`).

`game` plays the rounds; `players` are the built-in players, `protocol_robots` lets protocols play, and `command_seats`
lets outside programs play by JSON lines (`json_lines`). `report` says how well they played, and who broke which rule.
"""

from robochoc.seats.game import Game, GameOptions, header_of, play
from robochoc.seats.moves import Limits
from robochoc.seats.report import GameReport, SeatReport

__all__ = ["Game", "GameOptions", "GameReport", "Limits", "SeatReport", "header_of", "play"]
