"""The command line: parse, call, print. To start fast, commands import the modules they need when they run."""
