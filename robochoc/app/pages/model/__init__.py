"""The page "Model" of a team."""
