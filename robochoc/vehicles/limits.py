"""The waiting times of pilots and the tolerances for positions, which are the same for all vehicles."""

from __future__ import annotations

CLIMB_S = 30.0
"""The longest time of a take-off, in seconds."""
MODE_S = 3.0
"""The longest time until a vehicle reports a new mode, in seconds: heartbeats come once a second."""
OUTSIDE_M = 1.0
"""A vehicle in the air farther outside the fence than this must land, in metres."""
RETRY_S = 0.5
"""The interval between attempts if a command at the end is refused, in seconds."""
END_S = 10.0
"""Commands at the end are repeated for this time, in seconds."""
LANDING_S = 90.0
"""The longest wait for a landing, in seconds."""
TURN_S = 60.0
"""The longest wait at the end for the landing of vehicles that are in the way, in seconds."""
GIVE_WAY_S = 20.0
"""The longest time that a vehicle out of order waits until no vehicle is directly below, in seconds."""
SILENCE_S = 2.0
"""A vehicle that leaves our mode after a longer silence, in seconds, may have lacked set points (heartbeats: 1 Hz)."""
CLIMBED = 0.9
"""The fraction of the take-off height at which the take-off is complete."""
