"""The turn policy: what a turn fragment adds to a conversation (thesis Table 3.1), and which fragments may follow.

A person who ends a turn says so in three ways at once: the words stop, the eyes meet the hearer's, and the voice is
at its lowest (thesis 3.3.1). A robot that does none of this leaves the other to guess whose turn it is. So a turn
that begins announces to recognition which answer is awaited, and one that ends looks at the addressee in a low voice.

Fragments of one turn arrive one by one while earlier ones are still performed. The policy follows the turn as it
was accepted; whatever ends it early (barge-in, fault, cancellation, silence) also ends the fragments in line.
"""

from collections.abc import Callable, Collection, Iterator
from typing import Literal

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import EVERYBODY, TurnFragment, TurnStatus, ids_in
from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.recognition import Interjection
from engage_hri.schemas.requests import are_of_one_run
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.deadlines import Sight, Silences
from engage_hri.services.generation.turns.interjections import UNDECIDED, Interjections
from engage_hri.services.reports.action_reports import FACE_GRACE
from engage_hri.services.reports.same_people import renamed
from engage_hri.services.text.listening import is_listening, says_words

TURN_SILENCE: Seconds = 10.0
"""Silence after which an open turn closes as aborted. Recognition waits for its end for longer. Ours."""


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


_COMPLETE = Fault(reason="")


class Aborted(Struct, frozen=True):
    """A turn that ended early. fragments: its fragments that have not ended, in order.

    is_known: recognition has to be told, for the turn had begun and was not over.
    """

    turn: str
    addressee: str
    fragments: tuple[str, ...]
    why: Fault
    is_known: bool = False
    is_to_one: bool = True


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


class TurnPolicy:
    """The robot's turns, over streamed fragments. `deadline`: when to call `tick` at the latest."""

    def __init__(self, sight: Sight | None = None, barge_in: Seconds | None = None) -> None:
        """barge_in: `GenerationConfig.barge_in`."""
        self._barge_in = barge_in
        self._sight = sight or Sight("generation")
        self._waits = Silences[tuple[str, str]](self._sight)
        """The `_limits`, since `tick` was called."""
        self._open: TurnPlan | None = None
        """The turn that the next fragment would continue."""
        self._speaker = self._life = ""
        """The client that has begun the open turn: nobody else goes on with it, or ends it."""
        self._broken_off: Fault | None = None
        """Why the turn before was aborted; None: it was not."""
        self._live: dict[str, TurnPlan] = {}
        """Fragments accepted and not ended, in order."""
        self._begun: dict[str, bool] = {}
        """Turns of which a block was sent, and whether their end was signalled."""
        self._delay_target = ""
        """The entity to look at after the last fragment, if that holds the turn."""
        self._silent_since: Seconds | None = None
        self._away: dict[str, Seconds] = {}
        """People who are out of sight, and since when."""
        self.interjections = Interjections()
        self._taken_by = ""
        """The person who has taken the floor; "": nobody has."""

    @property
    def open_turn(self) -> str:
        return self._open.turn if self._open else ""

    @property
    def holds_the_turn(self) -> bool:
        return self._current is not None

    @property
    def _current(self) -> TurnPlan | None:
        """The turn that the robot has, until its end is signalled. A backchannel is said in the other's turn."""
        plans = self._turns_under_way
        return next((plan for plan in plans if not plan.backchannel and not self._begun.get(plan.turn)), None)

    def begins_again(self, requester: str, life: str) -> Aborted | None:
        """End the open turn of a client that was restarted since: nobody is there any more who would end it."""
        if self._open is None or requester != self._speaker or are_of_one_run(life, self._life):
            return None
        return self._abort(self._open, Fault(reason=f"{requester} was restarted", cause="restarted", whose=requester))

    def accept(
        self, fragment: TurnFragment, addressee: str | tuple[str, ...], requester: str = "", life: str = ""
    ) -> TurnPlan:
        """Take a fragment into the conversation. Raises InputRefused, and changes nothing, where it is illegal.

        addressee: one or several; may be empty for the rest of a turn. requester, life: of the client that sends it.
        """
        status = fragment.turn_status
        if fragment.id in {*self._live, *(plan.turn for plan in self._live.values()), self.open_turn}:
            reason = "a fragment or turn of this id goes on"
            raise _illegal(fragment, "id", reason, "give every fragment its own id")
        if status in ("middle", "end"):
            if self._open is None:
                advice = "begin a turn with 'beginning' or 'full'"
                error = _illegal(fragment, "turn_status", f"{status!r} with no turn open", advice)
                if requester == self._speaker and (why := self._broken_off) is not None:
                    reason = f"{error.fault.reason} any more: {why.reason}"
                    error = InputRefused(replace(error.fault, reason=reason, cause=why.cause, whose=why.whose))
                raise error
            turn = self._open.turn
            if requester != self._speaker:
                reason = f"turn {turn} is spoken by {self._speaker}, not by {requester}"
                raise _illegal(fragment, "turn_status", reason, "begin a turn of your own once that one is over")
            people = self._open.addressees
            addressee = addressee or people
            if {*ids_in(addressee)} != {*people}:
                reason = f"turn {turn} speaks to {', '.join(people)}, not to {', '.join(ids_in(addressee))}"
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
        if self._open is not None:
            # What is said before a question answers somebody, or nobody: the pair begins with the question.
            asks = plan.closes and fragment.turn_index == 1 and fragment.within is not None
            plan = replace(plan, announces_pair=asks and not self._open.announces_pair)
            if plan.interruptible is None:
                plan = replace(plan, interruptible=self._open.interruptible)
            if plan.interruptible_after is None:
                plan = replace(plan, interruptible_after=self._open.interruptible_after)
        self._live[fragment.id] = plan
        self._delay_target = fragment.delay_target if fragment.delay else ""
        if status == "beginning":
            self._open, self._speaker, self._life, self._broken_off = plan, requester, life, None
        elif status == "end":
            self._open = None
        self._silent_since = None
        return plan

    def fragment_begins(self, turn: str) -> None:
        """Note that the block of a fragment of `turn` is on its way."""
        self._begun.setdefault(turn, False)

    def rename(self, name: Callable[[str], str]) -> None:
        """Speak to people by other ids from now on. name: the new one of each."""
        self._live = {id: renamed(plan, name) for id, plan in self._live.items()}
        self._open = self._open and renamed(self._open, name)
        self._away = {name(id): since for id, since in self._away.items()}
        self.interjections.rename(name)

    def turn_ended(self, turn: str, now: Seconds) -> None:
        """Note that a turn is over: its end was signalled. Its last block may go on for a moment."""
        if turn in self._begun:
            self._begun[turn] = True
            self.interjections.turn_over(turn, now, went_on=True)

    def fragment_ended(self, id: str, *, complete: bool, now: Seconds, why: Fault = _COMPLETE) -> Aborted | None:
        """End a fragment. Its turn is aborted unless the block was performed completely. why: it was not."""
        plan = self._live.pop(id, None)
        if plan is None:
            return None
        if not complete:
            return self._abort(plan, why)
        if self._open is not None and not self._live:
            self._silent_since = now
        self._forget()
        return None

    def rest_refused(self, fragment: TurnFragment, requester: str, why: Fault) -> Aborted | None:
        """End the open turn if its rest was refused, before it was accepted, for what has happened to somebody."""
        is_rest = fragment.turn_status in ("middle", "end") and requester == self._speaker
        if self._open is None or not is_rest or not why.cause:
            return None
        return self._abort(self._open, _refused(fragment.id, why))

    def fragment_refused(self, id: str, now: Seconds, why: Fault = _COMPLETE) -> Aborted | None:
        """Take back a fragment that the realizer has refused.

        Its turn goes on for another fragment, unless this one began it, or something has happened to somebody (`why`
        has a cause): then the turn ends as if the fragment had failed a moment later.
        """
        plan = self._live.get(id)
        if plan is None:
            return None
        other = self._open is not None and self._open.turn != plan.turn
        if plan.turn == id or other or why.cause:
            return self.fragment_ended(id, complete=False, now=now, why=_refused(id, why))
        self._open = plan
        return self.fragment_ended(id, complete=True, now=now)

    @property
    def averted_to(self) -> str:
        """The entity at which the robot looks while its open turn pauses; "": it does not avert its gaze."""
        return self._delay_target if self._open is not None and not self._live else ""

    def interject(self, told: Interjection, now: Seconds) -> None:
        """Note what somebody says into the robot's turn, or that recognition has decided what it is."""
        current = self._current
        if current is None or current.turn not in self._begun:
            self.interjections.feed(told, "", now, after=None)
        elif self.interjections.feed(told, current.turn, now, after=current.gives_way_after(told.actor)):
            self._taken_by = told.actor

    def hear(self, utterance: Utterance, now: Seconds) -> None:
        """Note words, by which a voice without any may turn out to interrupt, or one that nobody decides."""
        actor, text = utterance.actor, utterance.text
        if not utterance.final or not says_words(text) or is_listening(text):
            return
        self.interjections.hear(actor, text)
        if self.interjections.decide_wordless(actor, now, has_words=True):
            self._taken_by = actor

    @property
    def held(self) -> str:
        """The turn that waits because it is undecided whether somebody interrupts it; "": none does."""
        current = self._current
        return current.turn if current is not None and self.interjections.waits_in(current.turn) else ""

    def goes_on(self, fragment: str) -> bool:
        """True if a fragment has neither ended nor is its turn broken off."""
        return fragment in self._live

    def see(self, people: Collection[str], now: Seconds) -> None:
        """Note who is in sight."""
        away = {actor for plan in self._turns_under_way for actor in plan.addressees} - {*people}
        self._away = {actor: self._away.get(actor, now) for actor in away}

    @property
    def _turns_under_way(self) -> tuple[TurnPlan, ...]:
        return (*self._live.values(), *([self._open] if self._open else []))

    @property
    def _limits(self) -> dict[tuple[str, str], Seconds]:
        """Times until which others may go on as they do: be away or undecided, by person, and be silent, by turn.

        Of a turn to several people one has to stay.
        """
        turn = self._current.turn if self._current is not None else ""
        waiting = self.interjections.waits_in(turn)
        limits = {("undecided", actor): opened + UNDECIDED for actor, opened in waiting.items()}
        limits |= {("counts", actor): at for actor, at in self.interjections.unheeded_in(turn).items()}
        limits |= {("lasts", actor): at for actor, at in self.interjections.wordless_in(turn).items()}
        if self._barge_in is not None:
            voiced = self.interjections.voiced_in(turn)
            limits |= {("talks", actor): opened + self._barge_in for actor, opened in voiced.items()}
        if self._silent_since is not None:
            limits["silent", self.open_turn] = self._silent_since + TURN_SILENCE
        return limits | {("away", who): self._away[who] + FACE_GRACE for who, _ in self._left_alone}

    @property
    def _left_alone(self) -> Iterator[tuple[str, TurnPlan]]:
        """Turns all of whose addressees are out of sight, each with the one that was there last."""
        for plan in self._turns_under_way:
            if self._away.keys() >= {*plan.addressees}:
                yield max(plan.addressees, key=lambda each: self._away[each]), plan

    @property
    def deadline(self) -> Seconds | None:
        return min((self._waits.standing(*each) for each in self._limits.items()), default=None)

    def tick(self, now: Seconds) -> Aborted | None:
        """Abort the turn that silence, a barge-in or the leaving of its addressee has ended by `now`; None: none."""
        limits = self._limits
        for name in [name for name in self._waits if name not in limits]:
            self._waits.clear(name)
        for name, at in limits.items():
            self._waits.keep(name, at, now)
        why, who = self._waits.due(now) or ("", "")
        while why in ("undecided", "counts", "lasts"):
            if why == "undecided":
                if self.interjections.give_up(who, now):
                    self._taken_by = who
            elif why == "lasts":
                if self.interjections.decide_wordless(who, now, has_words=False):
                    self._taken_by = who
            elif self.interjections.heed(who, now):
                self._taken_by = who
            why, who = self._waits.due(now) or ("", "")
        if why == "away":
            left = next(plan for last, plan in self._left_alone if last == who)
            return self._abort(left, self._sight.fault(f"{who} has left", "", "gone", who, "", self._away[who]))
        if why == "silent":
            assert self._open is not None
            assert self._silent_since is not None
            silence = f"silence for {TURN_SILENCE:g} s"
            since, speaker = self._silent_since, self._speaker
            return self._abort(self._open, self._sight.fault(silence, "", "late", speaker, "", since))
        if (actor := self._taken_by or (who if why == "talks" else "")) and (current := self._current) is not None:
            return self._abort(current, Fault(reason=f"{actor} took the floor", cause="cancelled", whose=actor))
        return None

    def _abort(self, plan: TurnPlan, why: Fault) -> Aborted:
        self._broken_off, self._taken_by = why, ""
        if self._open is not None and self._open.turn == plan.turn:
            self._open = None
            self._silent_since = None
        ended = tuple(id for id, live in self._live.items() if live.turn == plan.turn)
        for id in ended:
            del self._live[id]
        is_known = self._begun.get(plan.turn) is False
        self._forget()
        return Aborted(plan.turn, plan.addressee, ended, why, is_known, is_to_one=not plan.others)

    def _forget(self) -> None:
        """Drop what is known of turns that are over."""
        kept = {plan.turn for plan in self._live.values()} | {self.open_turn}
        self._begun = {turn: is_over for turn, is_over in self._begun.items() if turn in kept}
        if self._current is None:
            self._taken_by = ""


def _refused(id: str, why: Fault) -> Fault:
    refused = f"{id} was refused"
    return why.following(refused, "") if why.reason else Fault(reason=refused)


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


def _illegal(fragment: TurnFragment, field: str, reason: str, advice: str) -> InputRefused:
    return InputRefused(Fault(reason=reason, where=f"{fragment.id}: $.{field}", line=fragment.line, advice=advice))
