"""Files of other tools: FRODO, DisChoco, pyDCOP, XCSP3, toulbar2. Each module reads and writes one format."""
