"""Several machines, on eclipse-zenoh: a master that listens, and robots that know their own file and its address.

`robot.py` and `master.py` are the two ends, `words.py` what they say, `frames.py` what goes around each word,
`transport.py` and `router.py` what zenoh does for them (nothing else imports it), `access.py` who may write to whom,
`profile.py` and `shared.py` what a robot tells of its file, `local.py` all of it on one machine.
"""
