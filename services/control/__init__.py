"""The service `control`: the contract of a body, the simulated torso, and the service that puts a body on the bus."""
