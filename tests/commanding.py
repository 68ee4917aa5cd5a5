"""Commands as they travel, without a requester that keeps at them."""

from typing import Any

from engage_hri.schemas import keys
from engage_hri.services.bus.interface import Bus


def command(bus: Bus, expression: str, message: Any) -> None:
    """Publish it once, on the key of this participant."""
    bus.publish(key_of(bus, expression), message)


def key_of(bus: Bus, expression: str) -> str:
    return keys.command(expression, bus.role, bus.name)
