"""The waiting times of a pilot, and the tolerances of positions: the same for all vehicles."""

from __future__ import annotations

CLIMB_S = 30.0
"""The longest time of a take-off, in seconds."""
MODE_S = 3.0
"""The time within which a vehicle reports a new mode, in seconds: heartbeats come once a second."""
OUTSIDE_M = 1.0
"""A vehicle in the air that is farther outside of the fence is made to land."""
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
"""A vehicle that leaves our mode after a longer silence may have lacked set points. Heartbeats come once a second."""
CLIMBED = 0.9
"""The share of the take-off height at which the take-off is complete."""
