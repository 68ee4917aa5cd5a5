"""Faults of devices and of what comes from people, as senses tell them: they are no bugs of ours."""

from collections import deque

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.services.bus import journal
from engage_hri.services.bus.interface import Bus


class SenseFaults:
    """Tells the faults of a sense. back: words for its device when it gives something again."""

    def __init__(self, bus: Bus, back: str = "seeing again") -> None:
        self._bus, self._back = bus, back
        self._told: deque[str] = deque(maxlen=16)
        """Reasons of those that are told once, the last ones."""
        self._is_lost = False

    def tell(self, fault: Fault) -> None:
        """Tell a fault."""
        journal.alert(self._bus.log, "%s", fault)
        self._bus.publish(keys.fault(self._bus.name), replace(fault, service=self._bus.name))

    def tell_once(self, fault: Fault) -> None:
        """Tell a fault, if it has not been told lately."""
        if fault.reason not in self._told:
            self._told.append(fault.reason)
            self.tell(fault)

    def lose(self, fault: Fault) -> None:
        """Tell why a device gives nothing, once until it does."""
        if not self._is_lost:
            self._is_lost = True
            self.tell(fault)

    def get(self) -> None:
        """Take it that the device gives something, and tell so if it did not."""
        if self._is_lost:
            self._is_lost = False
            journal.alert(self._bus.log, self._back)
