"""A robot that turns a sentence into physical action, and knows why it did each thing."""

__version__ = "0.1.0"
