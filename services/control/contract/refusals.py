"""Behaviors that no body is asked about: senseless ones, types that it lacks, and what is forbidden here. Pure."""

import math
from collections.abc import Iterable

from engage_hri.schemas.behaviors import BlockBehavior, Pointing
from engage_hri.schemas.blocks import WarningKind
from engage_hri.schemas.body import Capabilities, Estimate, NoPointZone
from engage_hri.schemas.check import check_behavior
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.references import type_name
from engage_hri.schemas.world import World

VOICE_ADVICE = "--voice espeak to be heard, --voice silent to take the time of words alone"


class Impossible(Exception):
    """The body cannot do a behavior. kind: of the warning that says so. reason, advice: in words."""

    def __init__(self, kind: WarningKind, reason: str, advice: str = "") -> None:
        super().__init__(reason)
        self.kind = kind
        self.reason = reason
        self.advice = advice

    def fault(self, behavior: BlockBehavior) -> Fault:
        """Describe it as a fault of the behavior that was asked for."""
        return Fault(reason=self.reason, where=behavior.id, advice=self.advice, service="control")

    def estimate(self, behavior: BlockBehavior) -> Estimate:
        """The estimate of the behavior that was asked for: it cannot be done."""
        return infeasible(behavior.id, self.kind, self.fault(behavior))


def refusal(
    behavior: BlockBehavior, able: Capabilities, zones: Iterable[NoPointZone], world: World
) -> Estimate | None:
    """The estimate of a behavior that the body is not asked about; None: it is to be asked.

    zones: balls that nothing may point into, whatever the body says.
    """
    try:
        check_behavior(behavior)
    except InputRefused as error:
        return infeasible(behavior.id, "CANNOT_CREATE_BEHAVIOR", error.fault)
    if type_name(behavior) not in able.types:
        return unsupported(behavior)
    target = world.entity(behavior.target) if isinstance(behavior, Pointing) else None
    if target is not None and any(math.dist(zone.center, target.position) <= zone.radius for zone in zones):
        fault = _fault(behavior, f"{target.id!r} is in a no-point zone")
        return infeasible(behavior.id, "CANNOT_CREATE_BEHAVIOR", fault)
    return None


def unsupported(behavior: BlockBehavior) -> Estimate:
    """The estimate of a behavior of a type that a body does not perform."""
    name = type_name(behavior)
    advice = f"; give it a voice: {VOICE_ADVICE}" if name == "speech" else ""
    return infeasible(
        behavior.id, "BEHAVIOR_TYPE_NOT_SUPPORTED", _fault(behavior, f"this body has no {name}{advice}")
    )


def _fault(behavior: BlockBehavior, reason: str) -> Fault:
    return Fault(reason=reason, where=behavior.id, service="control")


def infeasible(behavior: str, warning: str, fault: Fault) -> Estimate:
    """The estimate of a behavior, by its id, that cannot be done."""
    return Estimate(behavior=behavior, feasible=False, fault=fault, warning=warning)
