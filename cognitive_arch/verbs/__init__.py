"""The verbs of the command line that belong together, one module each; `cli.py` puts them together."""
