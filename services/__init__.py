"""Engage's services, one package per process, and what they share: the bus, how a service lives, the client."""
