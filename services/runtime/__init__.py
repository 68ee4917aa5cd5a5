"""How a service lives: on the bus, with a status, on real or virtual time."""
