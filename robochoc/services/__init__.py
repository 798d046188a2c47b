"""The Services Management unit: the Directory Facilitator, who knows which robot offers what."""
