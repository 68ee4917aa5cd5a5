"""Bodies: the contract, the simulated torso, and the service that puts a body on the bus."""
