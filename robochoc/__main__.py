"""`python -m robochoc` is `robochoc`."""

from robochoc.cli.main import main

main()
