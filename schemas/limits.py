"""Limits of what is read."""

LARGEST = 4 * 1024 * 1024
"""Bytes of a message or a document, in whatever form. A block of a thousand behaviors has about 200 kB."""
