"""A fuzzer of all that robochoc reads from strangers: `make fuzz`.

`file_targets`, `foreign_targets` and `wire_targets` say what is read and what must hold of it, `mutations` how valid
inputs are spoilt, `harness` what every input may cost, and `__main__` runs it all.
"""
