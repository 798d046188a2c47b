"""Mutation testing: code is spoilt in one place, and the tests should notice (`make mutate`)."""
