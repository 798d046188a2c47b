"""Watching from outside: events, the journal, metrics, and the checker. Protocols do not know."""
