"""The simulated torso: a body whose motion is computed in closed form, with configured faults."""
