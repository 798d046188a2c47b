"""The page "Decide" of a team."""
