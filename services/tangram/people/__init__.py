"""Simulated people: who sits at the tangram table, what cameras see of them, and two people without a robot."""
