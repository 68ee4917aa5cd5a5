"""Perception: services that find out what people do from sensors, and tell it on the bus, as others may.

child.py    a process with pipes, on the loop
"""
