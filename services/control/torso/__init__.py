"""The simulated torso: a body in closed form, with the faults that are asked of it."""
