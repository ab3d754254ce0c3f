"""The physical side: the only package that imports pydrake."""

import logging

# Imported here because Drake sets its logger's level itself when it is first imported.
import pydrake.common

__all__ = ["pydrake"]

# Drake greets on stderr whenever it opens a viewer port; nobody asked for one.
logging.getLogger("drake").setLevel(logging.WARNING)
