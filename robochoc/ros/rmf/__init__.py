"""Open-RMF: a dispatcher and a bidder that send and receive the task messages of RMF (package rmf_task_msgs).

`dispatcher.py` and `bidder.py` are pure: messages and the time go in, messages come out. `exchange.py` connects them
with a middleware.
"""
