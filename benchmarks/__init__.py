"""Measurements that cannot fail a test: `make bench`."""
