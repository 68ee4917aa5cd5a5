"""Driver of Reachy Mini, a small robot with a head, a turning base and two antennas, through its daemon."""
