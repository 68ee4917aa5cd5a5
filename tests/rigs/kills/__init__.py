"""Kills of a process of a robot, again and again, while a manager has it speak: `python -m tests.rigs.kills`."""
