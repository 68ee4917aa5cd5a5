"""The shared vocabulary: messages, key expressions, XML and JSON codecs. No I/O, no clock.

One file per message domain; `schemas/keys.py` is the table of what travels where.
"""
