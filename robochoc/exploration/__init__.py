"""Explores every order in which messages can arrive, on small teams: `robochoc check`.

A protocol object is pure, so the code that runs on robots is explored itself, not a model of it. `local_steps` computes
what a robot does on a message, once for each of its states; `state_graph` combines these steps to the states of the
whole team; `changes` lets robots crash and the problem change, as in a run; `judgement` tests the properties that must
hold in all states; `check` explores a protocol on many small teams.
"""
