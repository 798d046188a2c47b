"""The runtime across machines, on eclipse-zenoh: a master, and robots that know only their own file and its address.

`robot.py` and `master.py` are the two ends, `control_messages.py` defines their messages, `framing.py` the frame around
each message. `transport.py` and `router.py` use zenoh (no other module imports it), `access.py` defines the rights to
write, `profile.py` and `constraint_records.py` the parts of its file that a robot discloses. `local.py` runs everything
on one machine.
"""
