"""Constraint Solver unit: compiles each robot's own problem for the protocols, and solves whole teams."""
