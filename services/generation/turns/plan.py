"""Share of a turn fragment in a conversation: thesis Table 3.1.

A person who ends a turn says so in three ways at once: the words stop, the eyes meet the hearer's, and the voice is
at its lowest (thesis 3.3.1). A robot that does none of this leaves the other to guess whose turn it is. So a turn
that begins announces to recognition which answer is awaited, and one that ends looks at the addressee in a low voice.
"""

from collections.abc import Iterator
from typing import Literal

from msgspec import Struct

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.fragments import EVERYBODY, TurnFragment, TurnStatus, ids_in
from engage_hri.schemas.units import Seconds


class StatusRule(Struct, frozen=True):
    """One row of Table 3.1. opens: announce an adjacency pair, or the reply to one. closes: end with facial gaze."""

    opens: bool
    closes: bool
    backchannel: bool = False


TABLE: dict[TurnStatus, StatusRule] = {
    "beginning": StatusRule(opens=True, closes=False),
    "middle": StatusRule(opens=False, closes=False),
    "end": StatusRule(opens=False, closes=True),
    "full": StatusRule(opens=True, closes=True),
    "backchannel": StatusRule(opens=False, closes=False, backchannel=True),
}


class TurnPlan(Struct, frozen=True, kw_only=True):
    """The behavior that a fragment adds. turn: id of the fragment that opened the turn; its own for a backchannel.

    addressee: of several the one named first. others: the others. interruptible, interruptible_after: as in the
    fragment.
    """

    turn: str
    addressee: str
    others: tuple[str, ...] = ()
    interruptible: bool | str | tuple[str, ...] | None = None
    interruptible_after: Seconds | None = None
    accept: tuple[Action, ...] = ()
    within: Seconds | None = None
    announces_pair: bool = False
    reply: Literal["", "answered", "repaired"] = ""
    """Message of a second or third turn, which starts no pair: tells recognition what became of the pending one."""
    closes: bool = False
    backchannel: bool = False

    @property
    def addressees(self) -> tuple[str, ...]:
        return (self.addressee, *self.others)

    def gives_way_after(self, actor: str) -> Seconds | None:
        """Seconds for which this person has to speak to interrupt it; None: however long, it goes on."""
        named = self.interruptible
        if isinstance(named, str | tuple):
            may = not {actor, EVERYBODY}.isdisjoint(ids_in(named))
        else:
            may = named is not False and actor in self.addressees
        return (self.interruptible_after or 0.0) if may else None


def plan_turn(fragment: TurnFragment, turn: str, addressee: str | tuple[str, ...]) -> TurnPlan:
    """Apply Table 3.1 to a legal fragment of turn `turn`."""
    rule = TABLE[fragment.turn_status]
    first, *others = ids_in(addressee) or ("",)
    return TurnPlan(
        turn=turn,
        addressee=first,
        others=tuple(others),
        interruptible=fragment.interruptible,
        interruptible_after=fragment.interruptible_after,
        accept=fragment.accept,
        within=fragment.within,
        announces_pair=rule.opens and fragment.turn_index == 1,
        reply=("answered" if fragment.turn_index == 2 else "repaired")
        if rule.opens and fragment.turn_index != 1
        else "",
        closes=rule.closes,
        backchannel=rule.backchannel,
    )


def in_vain(fragment: TurnFragment, turn: TurnPlan) -> Iterator[str]:
    """Warnings for what a fragment asks for in vain: holding a turn that is not held, time that nobody waits."""
    status = fragment.turn_status
    if fragment.delay_target and not fragment.delay:
        yield "delayTarget without delay='true': the turn is not held"
    elif fragment.delay and status not in ("beginning", "middle"):
        yield f"delay: after {status!r} there is no turn to hold"
    elif fragment.delay and not fragment.delay_target:
        yield "delay: the world has no surface to look at; name a delayTarget"
    if fragment.within is not None and not turn.announces_pair:
        yield "within: an answer is awaited where a first turn begins, or at the end of one that has asked for none"
