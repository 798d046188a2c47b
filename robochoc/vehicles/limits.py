"""The times that a pilot waits, and the distances that a vehicle may stray: the same for all vehicles."""

from __future__ import annotations

CLIMB_S = 30.0
"""The longest time of a take-off, in seconds."""
MODE_S = 3.0
"""The time within which a vehicle reports a new mode, in seconds: heartbeats come once a second."""
OUTSIDE_M = 1.0
"""A vehicle in the air may be that far out of the fence before it is made to land."""
RETRY_S = 0.5
"""The interval between refused commands at the end, in seconds."""
END_S = 10.0
"""Commands at the end are repeated for this time, in seconds."""
LANDING_S = 90.0
"""The longest wait for a landing, in seconds."""
TURN_S = 60.0
"""The longest wait at the end for vehicles in the way to land, in seconds."""
GIVE_WAY_S = 20.0
"""The longest wait of a vehicle out of order until no vehicle is right below it, in seconds."""
SILENCE_S = 2.0
"""After a longer silence a vehicle that has left our mode did so for want of set points: a heartbeat a second is usual.
"""
CLIMBED = 0.9
"""The part of a take-off's height from which on the vehicle is sent elsewhere."""
