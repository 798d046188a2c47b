"""Communication Management unit: how envelopes travel, in one thread or between processes."""
