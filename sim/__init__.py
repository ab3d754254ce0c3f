"""The physical side: the only package that imports pydrake."""

import logging

# Drake greets on stderr whenever it opens a viewer port; nobody asked for one.
logging.getLogger("drake").setLevel(logging.WARNING)
