"""The page "What if" of a team."""
