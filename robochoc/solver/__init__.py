"""Constraint Solver unit: a robot's own problem, made ready for protocols."""
