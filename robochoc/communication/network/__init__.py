"""Several machines, on eclipse-zenoh: a master that listens, and robots that know their own file and its address.

`robot.py` and `master.py` are the two ends, `control_messages.py` their messages, `framing.py` what goes around each
message, `transport.py` and `router.py` what zenoh does for them (nothing else imports it), `access.py` who may write to
whom, `profile.py` and `constraint_records.py` what a robot discloses of its file, `local.py` all of it on one machine.
"""
