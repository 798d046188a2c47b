"""Protocols that improve all values cycle by cycle and prove nothing, one file each."""
