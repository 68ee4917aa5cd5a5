"""A laboratory of several machines on one: network namespaces, joined by a switch that delays, loses and cuts."""
