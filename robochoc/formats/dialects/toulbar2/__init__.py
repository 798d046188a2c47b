"""Cost function networks, toulbar2's formats (https://github.com/toulbar2/toulbar2)."""
