"""Protocols whose robots send tables of costs or utilities instead of trying single values, one file each."""
