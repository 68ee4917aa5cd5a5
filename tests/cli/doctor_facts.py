"""Facts about a robot that is well, to be made ill in one place."""

from typing import Any

import msgspec

from engage_hri.schemas import keys
from engage_hri.schemas.participants import BusHealth, ClockOffset, ProcessFacts, Reachable, Status
from engage_hri.schemas.units import Stamp
from engage_hri.services.doctor.findings import (
    BodyFacts,
    EndpointFacts,
    ParticipantFacts,
    SystemFacts,
    WorldFacts,
)

NAMES = (*keys.SERVICES, "simulation")
AT = 1_700_000_000.0
OWN = ProcessFacts(host="desk", python="3.11.7", zenoh="1.10.2", mode="client", connect=("tls/router:7447",))


def known(name: str, clock: str = "here", **changes: Any) -> ParticipantFacts:
    """Somebody who answers, and sees all others. changes: of it, its status, its process and its health."""
    clocks = () if clock == "here" else (ClockOffset(clock="here", offset=3.0, error=0.001, trip=0.002),)
    mine = (ClockOffset(clock="there", offset=-3.0, error=0.001, trip=0.002),) if clock == "here" else clocks
    health = msgspec.structs.replace(BusHealth(peers=NAMES, clocks=mine), **changes.pop("bus", {}))
    process = msgspec.structs.replace(OWN, **changes.pop("process", {}))
    status = Status(
        participant=name, run=name, version="0.1.0", at=Stamp(clock, 50.0), joined=Stamp(clock, 0.0),
        stands=Stamp(clock, 1.0), bus=health, process=process,
    )  # fmt: skip
    status = msgspec.structs.replace(status, **changes.pop("status", {}))
    return msgspec.structs.replace(ParticipantFacts(name=name, status=status, later=status, trip=0.001), **changes)


def well(**changes: Any) -> SystemFacts:
    """A robot on two machines, with nothing to complain of. changes: of the facts."""
    facts = SystemFacts(
        robot="robot", at=AT, version="0.1.0", protocol=keys.PREFIX, own=OWN, services=keys.SERVICES,
        doors=(
            EndpointFacts(endpoint="tls/router:7447", is_local=False, is_closed=True, until=int(AT) + 365 * 86400),
        ),
        protocols=(keys.PREFIX,),
        known=tuple(known(name, "there" if name == "simulation" else "here") for name in NAMES),
        body=BodyFacts(name="simulated", types=("speech", "gaze")),
        sight=WorldFacts(source="simulation", people=1, objects=10, age=2.0),
    )  # fmt: skip
    return msgspec.structs.replace(facts, **changes)


def with_one(name: str, clock: str = "here", **changes: Any) -> SystemFacts:
    """The same with one participant in another state: see `known`."""
    facts = well()
    return msgspec.structs.replace(
        facts, known=tuple(known(name, clock, **changes) if one.name == name else one for one in facts.known)
    )


def listening(*places: str) -> dict[str, Any]:
    """Health of one who knows where the simulation listens."""
    return {"reachable": (Reachable("simulation", places),)}
