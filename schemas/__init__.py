"""The shared vocabulary: messages, key expressions, XML and JSON codecs. No I/O, no clock.

One file per message domain; `schemas.keys` is the table of what travels where.
"""
