"""What a turn fragment adds to a conversation (thesis Table 3.1), and whether the turn may go on like this.

Fragments of one turn arrive one by one while earlier ones are still performed. The policy follows the turn as it
was accepted; whatever ends it early (barge-in, fault, cancellation, silence) also ends the fragments in line.
"""

from typing import Literal

from msgspec import Struct

from schemas.actions import ActionBegan, ActionEnded
from schemas.behaviors import Action
from schemas.faults import Fault, InputRefused
from schemas.fragments import TurnFragment, TurnStatus
from schemas.units import Seconds
from services.generation.config import GenerationConfig


class StatusRule(Struct, frozen=True):
    """One row of Table 3.1. opens: announce the pair, if this is its first turn. closes: facial gaze and MFG."""

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
    """What a fragment adds. turn: id of the fragment that opened the turn; its own for a backchannel."""

    turn: str
    addressee: str
    accept: tuple[Action, ...] = ()
    announces_pair: bool = False
    reply: Literal["", "answered", "repaired"] = ""
    """Second and third turns start no pair: they tell recognition what became of the pending one."""
    closes: bool = False
    backchannel: bool = False


class Aborted(Struct, frozen=True):
    """A turn that ended early. fragments: those of it not yet ended, in order."""

    turn: str
    addressee: str
    fragments: tuple[str, ...]
    reason: str


def plan_turn(fragment: TurnFragment, turn: str, addressee: str) -> TurnPlan:
    """Table 3.1 for a legal fragment of turn `turn`."""
    rule = TABLE[fragment.turn_status]
    return TurnPlan(
        turn=turn,
        addressee=addressee,
        accept=fragment.accept,
        announces_pair=rule.opens and fragment.turn_index == 1,
        reply=("answered" if fragment.turn_index == 2 else "repaired")
        if rule.opens and fragment.turn_index != 1
        else "",
        closes=rule.closes,
        backchannel=rule.backchannel,
    )


class TurnPolicy:
    """The robot's turns, over streamed fragments. `deadline`: when to call `tick` at the latest."""

    def __init__(self, robot: str, config: GenerationConfig) -> None:
        self._robot = robot
        self._config = config
        self._open: TurnPlan | None = None
        """The turn that the next fragment would continue."""
        self._live: dict[str, TurnPlan] = {}
        """Fragments accepted and not ended, in order."""
        self._silent_since: Seconds | None = None
        self._robot_speaks = False
        self._interrupters: dict[str, Seconds] = {}
        """People who began to speak while the robot spoke, and when."""

    @property
    def open_turn(self) -> str:
        return self._open.turn if self._open else ""

    @property
    def holds_the_turn(self) -> bool:
        return self._open is not None or any(not plan.backchannel for plan in self._live.values())

    def accept(self, fragment: TurnFragment, addressee: str) -> TurnPlan:
        """Take a fragment into the conversation. Raises InputRefused, and changes nothing, where it is illegal.

        addressee: may be empty for the rest of a turn.
        """
        status = fragment.turn_status
        if fragment.id in self._live:
            reason = "a fragment with this id is being performed"
            raise _illegal(fragment, "id", reason, "give every fragment its own id")
        if status in ("middle", "end"):
            if self._open is None:
                advice = "begin a turn with 'beginning' or 'full'"
                raise _illegal(fragment, "turn_status", f"{status!r} with no turn open", advice)
            turn = self._open.turn
            addressee = addressee or self._open.addressee
            if addressee != self._open.addressee:
                reason = f"turn {turn} speaks to {self._open.addressee}, not to {addressee}"
                raise _illegal(fragment, "addressee", reason, "end the turn first")
        else:
            if status == "backchannel" and self.holds_the_turn:
                reason = "'backchannel' while the robot holds the turn"
                raise _illegal(fragment, "turn_status", reason, "end the turn first")
            if self._open is not None:
                reason = f"{status!r} while turn {self._open.turn} is open"
                raise _illegal(fragment, "turn_status", reason, "send its 'end' first")
            turn = fragment.id
        plan = plan_turn(fragment, turn, addressee)
        self._live[fragment.id] = plan
        if status == "beginning":
            self._open = plan
        elif status == "end":
            self._open = None
        self._silent_since = None
        return plan

    def fragment_ended(self, id: str, *, complete: bool, now: Seconds, reason: str = "") -> Aborted | None:
        """The fragment's block is over. Unless it was performed to its end its turn is aborted."""
        plan = self._live.pop(id, None)
        if plan is None:
            return None
        if not complete:
            return self._abort(plan, reason)
        if self._open is not None and not self._live:
            self._silent_since = now
        return None

    def thinks_after(self, fragment: TurnFragment) -> bool:
        """Is the gaze to be averted now, until the next fragment of this turn?"""
        return fragment.delay and bool(fragment.delay_target) and self._open is not None and not self._live

    def feed(self, message: ActionBegan | ActionEnded, now: Seconds) -> None:
        """Who speaks: a person who talks into the robot's speech for long takes the turn."""
        if message.action != "speak":
            return
        began = isinstance(message, ActionBegan)
        if message.actor == self._robot:
            self._robot_speaks = began
            if not began:
                self._interrupters.clear()
        elif not began:
            self._interrupters.pop(message.actor, None)
        elif self._robot_speaks:
            self._interrupters[message.actor] = now

    @property
    def deadline(self) -> Seconds | None:
        due = [began + self._config.barge_in for began in self._interrupters.values()] if self._live else []
        if self._silent_since is not None:
            due.append(self._silent_since + self._config.turn_silence)
        return min(due, default=None)

    def tick(self, now: Seconds) -> Aborted | None:
        """What silence or a barge-in has ended by `now`."""
        if self._silent_since is not None and now >= self._silent_since + self._config.turn_silence:
            assert self._open is not None
            return self._abort(self._open, f"silence for {self._config.turn_silence:g} s")
        for actor, began in self._interrupters.items():
            if now >= began + self._config.barge_in:
                self._interrupters.clear()
                interrupted = next((plan for plan in self._live.values() if plan.addressee == actor), None)
                return self._abort(interrupted, f"{actor} took the floor") if interrupted else None
        return None

    def _abort(self, plan: TurnPlan, reason: str) -> Aborted:
        if self._open is not None and self._open.turn == plan.turn:
            self._open = None
            self._silent_since = None
        ended = tuple(id for id, live in self._live.items() if live.turn == plan.turn)
        for id in ended:
            del self._live[id]
        return Aborted(plan.turn, plan.addressee, ended, reason)


def vain_delay(fragment: TurnFragment) -> tuple[str, ...]:
    """The warning that a fragment asks to hold the turn in a way that holds nothing; none if it does not."""
    if fragment.delay_target and not fragment.delay:
        return ("delayTarget without delay='true': the turn is not held",)
    if fragment.delay and fragment.turn_status not in ("beginning", "middle"):
        return (f"delay: after {fragment.turn_status!r} there is no turn to hold",)
    if fragment.delay and not fragment.delay_target:
        return ("delay without delayTarget: the gaze stays where it is",)
    return ()


def _illegal(fragment: TurnFragment, field: str, reason: str, advice: str) -> InputRefused:
    return InputRefused(Fault(reason=reason, where=f"{fragment.id}: $.{field}", line=fragment.line, advice=advice))
