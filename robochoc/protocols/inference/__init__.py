"""Protocols whose robots send tables of costs or utilities instead of values tried one by one: one file each."""
