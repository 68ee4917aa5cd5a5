"""The life of a service: on the bus, with a status, on real or virtual time."""
