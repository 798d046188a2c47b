"""The times that a pilot waits, and the distances that a vehicle may stray: the same for all vehicles."""

from __future__ import annotations

CLIMB_S = 30.0
"""The longest time of a take-off, in seconds."""
MODE_S = 3.0
"""The time within which a vehicle tells that it has changed its mode, in seconds: heartbeats come once a second."""
OUTSIDE_M = 1.0
"""A vehicle in the air may be that far out of the fence before it is made to land."""
RETRY_S = 0.5
"""The interval after which a command of the end is repeated that was refused, in seconds."""
END_S = 10.0
"""For so long commands of the end are repeated."""
LANDING_S = 90.0
"""The longest time of a landing that somebody waits for."""
TURN_S = 60.0
"""For so long a vehicle waits at the end until those that are in its way have landed."""
GIVE_WAY_S = 20.0
"""For so long a vehicle that is out of order waits until nobody is right below it any more."""
SILENCE_S = 2.0
"""After a longer silence a vehicle that has left our mode did so for want of set points: a heartbeat a second is usual.
"""
CLIMBED = 0.9
"""The part of a take-off's height from which on the vehicle is sent elsewhere."""
