"""Settings of these protocols, in files of the same names."""
