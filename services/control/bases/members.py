"""Members of a body of several drivers: what each has and can here, and which of them go together. Pure."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from engage_hri.schemas.body import JointLimit
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.control.contract.body import Body

GAZE_PART, LIPS_PART, VOICE_PART = "head", "face", "voice"
"""Parts whose owner tells the gaze axis, has the lips, and says what is being said."""
ARMS = ("left_arm", "right_arm")
PARTS_OF_TYPES = {
    **dict.fromkeys(("gaze", "gazeShift", "headDirectionShift", "head"), (GAZE_PART,)),
    **dict.fromkeys(("face", "faceLexeme", "faceFacs", "faceShift"), (LIPS_PART,)),
    **dict.fromkeys(("pointing", "gesture"), ARMS),
    **dict.fromkeys(("posture", "postureShift", "pose"), ("torso", *ARMS)),
    "speech": (VOICE_PART,),
}
"""Parts of which a type of behavior needs one, where a driver has such parts."""


@dataclass(frozen=True, eq=False)
class Member:
    """A driver in a composed body. name: as it was asked for. parts: those of its parts that it has here."""

    name: str
    body: Body
    parts: tuple[str, ...]

    @cached_property  # these are asked for each behavior, and many times a second
    def is_whole(self) -> bool:
        return set(self.parts) == set(self.body.capabilities.parts)

    @cached_property
    def types(self) -> tuple[str, ...]:
        """Types of behaviors that it can perform with the parts that it has here."""
        return tuple(name for name in self.body.capabilities.types if self._can(name))

    @cached_property
    def limits(self) -> tuple[JointLimit, ...]:
        """Limits of the joints that it has here."""
        every = self.body.capabilities.joints
        return every if self.is_whole else tuple(limit for limit in every if limit.part in self.parts)

    @cached_property
    def joints(self) -> frozenset[str]:
        """Names of the joints in `limits`."""
        return frozenset(limit.joint for limit in self.limits)

    def tells_of(self, joint: str) -> bool:
        """True if what it says of this joint counts; of a driver with all its parts that is everything."""
        return self.is_whole or joint in self.joints

    def _can(self, name: str) -> bool:
        needed = [part for part in PARTS_OF_TYPES.get(name, ()) if part in self.body.capabilities.parts]
        return not needed or any(part in self.parts for part in needed)

    def plays(self, fault: BodyFault) -> bool:
        """True if it can play this fault, at a part or a joint that it has here."""
        is_here = not fault.part or fault.part in self.parts or fault.part in self.joints
        return is_here and fault.kind in self.body.capabilities.faults

    def has(self, part: str) -> bool:
        """True if it has this part here. A driver with all its parts may have given the part another name."""
        return part in self.parts or (self.is_whole and part not in self.body.capabilities.parts)


def refuse_conflicts(members: Sequence[Member]) -> None:
    """Raise InputRefused if a part or a joint is of two of them."""
    owner: dict[tuple[str, str], Member] = {}
    for member in members:
        for kind, names in (("part", member.parts), ("joint", sorted(member.joints))):
            for name in names:
                other = owner.setdefault((kind, name), member)
                if other is not member:
                    reason = f"{other.name} and {member.name} both have the {kind} {name!r}"
                    rest = ",".join(part for part in member.parts if part not in other.parts)
                    spec = member.name.rpartition("=")[2]
                    advice = "say whose it is, by the parts that the other is to have"
                    advice += f": {rest}={spec}" if rest else ""
                    raise InputRefused(Fault(reason=reason, where="control.body", advice=advice, service="control"))


def refuse_carried(members: Sequence[Member]) -> None:
    """Raise InputRefused if a part that stands on another one, as a driver says, is not of the driver of that."""
    owner = {part: member for member in members for part in member.parts}
    stands = {
        (part, carrier): None for member in members for carrier, own in member.body.carries.items() for part in own
    }
    for part, carrier in stands:
        if part in owner and carrier in owner and owner[part] is not owner[carrier]:
            on, away = owner[carrier].name, owner[part].name
            reason = f"{part} of {away} stands on {carrier} of {on}, and {away} would not know where that is"
            advice = f"take {part} and {carrier} from one driver, or leave {carrier} out: then it stands still"
            raise InputRefused(Fault(reason=reason, where="control.body", advice=advice, service="control"))
