"""Faults of the body that are switched on and off on request, and told to whoever comes."""

from engage_hri.schemas import keys
from engage_hri.schemas.body_faults import BodyFaults, FaultsSwitched, SwitchFaults, flaw, switched
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.bus.interface import Bus
from engage_hri.services.control.contract.body import Body
from engage_hri.services.requests.ends import RequestDesk


class FaultSwitch:
    """Takes requests to switch faults, and publishes what is on."""

    def __init__(self, bus: Bus, body: Body, desk: RequestDesk) -> None:
        self._bus = bus
        self._body = body
        self._desk = desk
        self._by = ""
        """Participant that switched last; its faults stay on when it goes, or is killed."""

    def serve(self, request: SwitchFaults) -> None:
        """Carry out a request, and answer it."""
        for fault in request.on:
            if reason := flaw(fault, self._body.capabilities):
                advice = "`engage fault list` tells of all that it can play"
                self._desk.refuse(
                    request.id, Fault(reason=reason, where=fault.kind, advice=advice, service="control")
                )
                return
        try:
            self._body.switch_faults(switched(self._body.faults, request))
        except InputRefused as error:
            self._desk.refuse(request.id, error.fault)
            return
        self._desk.accept(request.id)
        self._by = request.requester
        self.tell()
        self._desk.end(FaultsSwitched(id=request.id, faults=self._body.faults))

    def tell(self) -> None:
        """Publish what is on."""
        self._bus.publish(keys.BODY_FAULTS, BodyFaults(at=self._bus.stamp(), faults=self._body.faults, by=self._by))
