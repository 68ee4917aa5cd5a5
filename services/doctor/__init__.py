"""Examination of a robot's bus: facts in, findings out. The command `engage doctor` gathers the facts."""
