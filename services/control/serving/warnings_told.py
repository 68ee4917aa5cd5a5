"""Warnings of what a person has to see to: on the bus, in the log, and from the command that serves."""

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.services.bus import journal
from engage_hri.services.bus.interface import Bus


def warn(bus: Bus, fault: Fault) -> None:
    """Tell of something that is wrong with the body, and not with a request."""
    journal.alert(bus.log, "control: %s", fault)
    bus.publish(keys.fault("control"), fault)


def recovered(bus: Bus, text: str) -> None:
    """Tell whoever sees the log that something is over of which it was warned."""
    journal.alert(bus.log, "control: %s", text)
