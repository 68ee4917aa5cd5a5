"""Faults of a simulated body: what can be switched on while it runs, and what is on. Thesis 4.2.2, 4.5.3, 5.4.3."""

from collections.abc import Iterable, Mapping

from msgspec import Struct

from engage_hri.schemas.behavior_types import SYNC_POINTS
from engage_hri.schemas.body import Capabilities, FaultKind
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.requests import Outcome, Request
from engage_hri.schemas.units import Stamp


class BodyFault(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A fault that a simulated body is to play.

    kind: one of `Capabilities.faults`; `KINDS` says what each does, and which of the other fields it takes.
    part: name of a body part, or of a joint; empty: every part that can have it.
    amount: how much, in the unit of its kind; None: as much as the kind says.
    before: the sync point before which it happens. behavior: id of the only behavior that it concerns; empty: all.
    """

    kind: str
    part: str = ""
    amount: float | None = None
    before: str = ""
    behavior: str = ""


class SwitchFaults(Request, frozen=True, kw_only=True, tag="switch_faults", omit_defaults=True):
    """cmd: operator or wizard -> control: switch faults of the body on and off. Ends in `FaultsSwitched`.

    A fault that is on and is not named stays on, so that two who switch at once do not undo one another.

    all_off: all faults go off first. off: then, of each of these, all that have the fields which it has. on: at last
        these come on; each replaces one that differs from it in its amount alone.

    It is refused, and nothing changes, if the body cannot play one of `on`, or if one of `off` is not on.
    """

    on: tuple[BodyFault, ...] = ()
    off: tuple[BodyFault, ...] = ()
    all_off: bool = False


class FaultsSwitched(Outcome, frozen=True, kw_only=True, tag="faults_switched", omit_defaults=True):
    """evt: terminal state of `SwitchFaults`: these are on."""

    faults: tuple[BodyFault, ...] = ()


class BodyFaults(Struct, frozen=True, kw_only=True, tag="body_faults", omit_defaults=True):
    """state: control. All faults that are switched on, by the configuration or since; none: the body is healthy.

    Published at the start and at every change; a late subscriber gets the last one.

    at: when it was published. by: participant that switched last; empty: the configuration did.
    """

    at: Stamp
    faults: tuple[BodyFault, ...] = ()
    by: str = ""


KINDS: Mapping[str, FaultKind] = {
    "slow": FaultKind(
        does="The part takes that many times as long as it says: sync points come late, and what is tied to them "
        "waits.",
        on="part", voice=True, amount="factor of time; below 1: quicker, within the limits", usual=2.0, low=0.05,
        high=100.0, behavior=True,
    ),
    "stall": FaultKind(
        does="The part stops half-way to a sync point (`before`; without it to its target), and goes on after a "
        "while. Meanwhile no point is reported; a behavior that is overdue is given up like any other.",
        on="part", amount="seconds; without it for ever", before=True, behavior=True,
    ),
    "overheated": FaultKind(
        does="The motor gives out half-way to a sync point (`before`; without it to the target): the behavior fails "
        "by that name, and the part goes home.",
        on="part", before=True, behavior=True,
    ),
    "noise": FaultKind(
        does="Each behavior is somewhat quicker or slower than it was said to be, drawn from the seed.",
        amount="standard deviation of the logarithm of its duration; 0.1 is about 10 %", usual=0.1, high=2.0,
        behavior=True,
    ),
    "displaced": FaultKind(
        does="The joint is elsewhere than the body believes, as if somebody had moved it, until a behavior moves it: "
        "that comes early or late, once.",
        on="joint", amount="degrees, its true angle", low=-180.0, high=180.0, needs_amount=True,
    ),
    "miscalibrated": FaultKind(
        does="The joint is beside the angle that it measures: looks and points are beside their targets, which "
        "people see and the body does not know. `engage calibrate body` measures it.",
        on="part or joint", amount="degrees by which its true angle is greater; of a part: of each of its joints",
        usual=4.0, low=-45.0, high=45.0,
    ),
    "mute": FaultKind(
        does="The voice makes no sound. One without sound of its own (`silent`, the simulated one) does not know it: "
        "words and marks are reported, and nobody hears them. One that sounds (`espeak`) notices that no sound is "
        "taken: words and lips stop, and the speech fails.",
    ),
    "voiceless": FaultKind(
        does="The voice cannot speak and knows it: it refuses what it is to say, and what it is saying fails.",
    ),
    "lost": FaultKind(
        does="Messages about sync points never come on the bus: what is tied to one waits, and goes on when it is "
        "overdue, or is given up; outcomes always come.",
        amount="share of these messages, 0 to 1", usual=0.1, high=1.0,
    ),
}  # fmt: skip
"""Faults that simulated bodies mean alike, but for those of which they say something else in their abilities."""
SYNCS = SYNC_POINTS[1:]
"""Sync points that a fault may come before."""


def kind_of(name: str, body: Capabilities) -> FaultKind | None:
    """Look up what a kind of fault is for a body; None: nobody says so."""
    return next((kind for kind in body.fault_kinds if kind.kind == name), KINDS.get(name))


def flaw(fault: BodyFault, body: Capabilities) -> str:
    """Say why a body cannot play a fault, as far as that is known without it; empty: it can."""
    if fault.kind not in body.faults:
        return f"this body cannot play {fault.kind!r}; it can play {', '.join(body.faults) or 'no fault'}"
    if (kind := kind_of(fault.kind, body)) is None:
        return ""
    superfluous = [
        name
        for name, given, is_taken in (
            ("part", fault.part, kind.on), ("amount", fault.amount is not None, kind.amount),
            ("before", fault.before, kind.before), ("behavior", fault.behavior, kind.behavior),
        )
        if given and not is_taken
    ]  # fmt: skip
    if superfluous:
        return f"{fault.kind} takes no {' and no '.join(superfluous)}"
    if (fault.part or kind.on == "joint") and fault.part not in (known := parts_of(kind, body)):
        return f"{fault.kind} of {fault.part!r}: known are {', '.join(known)}"
    if fault.before and fault.before not in SYNCS:
        return f"{fault.kind} before {fault.before!r}: known are {', '.join(SYNCS)}"
    if fault.amount is None:
        return f"{fault.kind} needs an amount: {kind.amount}" if kind.needs_amount else ""
    if not kind.low <= fault.amount <= kind.high:
        return f"the amount of {fault.kind} is {fault.amount:g}: expected {kind.low:g}..{kind.high:g} ({kind.amount})"
    return ""


def refuse(faults: Iterable[BodyFault], body: Capabilities, where: str = "") -> None:
    """Raise InputRefused if a body cannot play one of these faults.

    where: place that they come from; empty: the kind of the fault is told.
    """
    for fault in faults:
        if reason := flaw(fault, body):
            raise InputRefused(Fault(reason=reason, where=where or fault.kind, service="control"))


def parts_of(kind: FaultKind, body: Capabilities) -> tuple[str, ...]:
    """Names of the parts and joints of a body that a fault of this kind may concern. The face has no angles."""
    if kind.parts:
        return tuple(part for part in kind.parts if part in body.parts)
    parts = [part for part in body.parts if kind.voice or part != "voice"] if "part" in kind.on else []
    joints = [limit.joint for limit in body.joints if limit.part != "face"] if "joint" in kind.on else []
    return (*(part for part in parts if not joints or part not in ("face", "voice")), *joints)


def amount_of(fault: BodyFault) -> float | None:
    """Amount of a fault: the one that is given, else the usual one of its kind; None: there is none."""
    kind = KINDS.get(fault.kind)
    return fault.amount if fault.amount is not None or kind is None else kind.usual


def words(fault: BodyFault) -> str:
    """A fault in words: `slow right_arm 3`, `stall right_arm before stroke in wave`."""
    amount = amount_of(fault)
    said = (
        fault.kind, fault.part, "" if amount is None else f"{amount:g}",
        f"before {fault.before}" if fault.before else "", f"in {fault.behavior}" if fault.behavior else "",
    )  # fmt: skip
    return " ".join(filter(None, said))


def switched(before: tuple[BodyFault, ...], request: SwitchFaults) -> tuple[BodyFault, ...]:
    """Faults that are to be on after a request. before: those that are on.

    Raises InputRefused: one that is to go off is not on.
    """
    left = () if request.all_off else before
    for like in request.off:
        if not any(_is_meant(each, like) for each in left):
            raise InputRefused(Fault(reason="is not on", where=words(like), advice=f"on: {told(left)}"))
        left = tuple(each for each in left if not _is_meant(each, like))
    for fault in request.on:
        left = (*(each for each in left if _where(each) != _where(fault)), fault)
    return left


def told(faults: Iterable[BodyFault]) -> str:
    """Faults that are on, in words."""
    return ", ".join(map(words, faults)) or "nothing"


def _where(fault: BodyFault) -> tuple[str, ...]:
    return (fault.kind, fault.part, fault.before, fault.behavior)


def _is_meant(fault: BodyFault, like: BodyFault) -> bool:
    given = zip(_where(fault), _where(like), strict=True)
    return all(has == wanted or not wanted for has, wanted in given) and like.amount in (None, fault.amount)
