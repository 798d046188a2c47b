"""The runtime across machines, on eclipse-zenoh: a master, and robots that know only their file and its address.

`robot.py` and `master.py` are the two ends, `control_messages.py` their messages, `framing.py` the frame of each
message, `transport.py` and `router.py` the use of zenoh (no other module imports it), `access.py` the rights to write,
`profile.py` and `constraint_records.py` the parts of its file that a robot discloses, `local.py` all on one machine.
"""
