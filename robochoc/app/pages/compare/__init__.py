"""The page "Compare" of a team."""
