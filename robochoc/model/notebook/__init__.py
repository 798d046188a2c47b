"""Teams as pieces of a notebook's page."""
