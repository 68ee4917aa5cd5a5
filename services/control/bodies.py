"""Which body `control` puts on the bus. The simulated one is loaded when it is asked for: a robot never loads it."""

from engage_hri.services.control.body import Body
from engage_hri.services.control.config import ControlConfig


def simulated(config: ControlConfig) -> Body:
    """The torso, with the zones and faults of the configuration."""
    from engage_hri.services.control.torso.body import SimulatedBody

    return SimulatedBody(config.no_point_zones, config.variability)
