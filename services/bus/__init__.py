"""The bus: one interface, in memory and over Zenoh."""

from engage_hri.services.bus.interface import Bus, Hub, Keep, Received, Subscription
from engage_hri.services.bus.memory import Faults, MemoryHub

__all__ = ["Bus", "Faults", "Hub", "Keep", "MemoryHub", "Received", "Subscription"]
