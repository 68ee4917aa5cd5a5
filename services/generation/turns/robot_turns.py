"""The robot's turns: which fragments may follow, and whose turn it is until a turn is over. Pure.

Fragments of one turn arrive one by one while earlier ones are still performed. The turn is followed as it was
accepted; whatever ends it early (a policy of `policies.py`, fault, cancellation) also ends the fragments in line.
"""

from collections.abc import Callable, Hashable, Mapping

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import TurnFragment, ids_in
from engage_hri.schemas.requests import are_of_one_run
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.deadlines import Sight, Silences
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.followed import Followed, arranged, checked
from engage_hri.services.generation.turns.interjections import Interjections
from engage_hri.services.generation.turns.plan import TurnPlan, plan_turn
from engage_hri.services.generation.turns.policies import OWN
from engage_hri.services.generation.turns.policy import EarlyEnd, News, TurnPolicy, TurnScene
from engage_hri.services.reports.same_people import renamed

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


class RobotTurns:
    """The robot's turns, over streamed fragments. `deadline`: when to call `tick` at the latest."""

    def __init__(
        self,
        robot: str,
        config: GenerationConfig,
        policies: Mapping[str, type[TurnPolicy]] = {},
        sight: Sight | None = None,
    ) -> None:
        """policies: of installed packages."""
        self._scene = scene = TurnScene(robot, sight or Sight("generation"))
        ordered = arranged(OWN, policies, config.policies_off)
        self.policies = Followed(each(name, scene, config) for name, each in ordered.items())
        self._waits = Silences[tuple[str, Hashable]](scene.sight)
        """The `_limits`, since `tick` was called."""
        self._passed: set[tuple[tuple[str, Hashable], Seconds]] = set()
        """Limits that have passed, and end no turn: a policy that still names one is not asked for ever."""
        self._broken_off: Fault | None = None
        """Why the turn before was aborted; None: it was not."""
        self._delay_target = ""
        """The entity to look at after the last fragment, if that holds the turn."""

    @property
    def interjections(self) -> Interjections:
        return self._scene.interjections

    @property
    def open_turn(self) -> str:
        return self._scene.open.turn if self._scene.open else ""

    @property
    def holds_the_turn(self) -> bool:
        return self._scene.current is not None

    def begins_again(self, requester: str, life: str) -> Aborted | None:
        """End the open turn of a client that was restarted since: nobody is there any more who would end it."""
        if self._scene.open is None or requester != self._scene.speaker or are_of_one_run(life, self._scene.life):
            return None
        return self._abort(
            self._scene.open, Fault(reason=f"{requester} was restarted", cause="restarted", whose=requester)
        )

    def accept(
        self, fragment: TurnFragment, addressee: str | tuple[str, ...], requester: str = "", life: str = ""
    ) -> TurnPlan:
        """Take a fragment into the conversation. Raises InputRefused, and changes nothing, where it is illegal.

        addressee: one or several; may be empty for the rest of a turn. requester, life: of the client that sends it.
        """
        status = fragment.turn_status
        if fragment.id in {*self._scene.live, *(plan.turn for plan in self._scene.live.values()), self.open_turn}:
            reason = "a fragment or turn of this id goes on"
            raise _illegal(fragment, "id", reason, "give every fragment its own id")
        if status in ("middle", "end"):
            if self._scene.open is None:
                advice = "begin a turn with 'beginning' or 'full'"
                error = _illegal(fragment, "turn_status", f"{status!r} with no turn open", advice)
                if requester == self._scene.speaker and (why := self._broken_off) is not None:
                    reason = f"{error.fault.reason} any more: {why.reason}"
                    error = InputRefused(replace(error.fault, reason=reason, cause=why.cause, whose=why.whose))
                raise error
            turn = self._scene.open.turn
            if requester != self._scene.speaker:
                reason = f"turn {turn} is spoken by {self._scene.speaker}, not by {requester}"
                raise _illegal(fragment, "turn_status", reason, "begin a turn of your own once that one is over")
            people = self._scene.open.addressees
            addressee = addressee or people
            if {*ids_in(addressee)} != {*people}:
                reason = f"turn {turn} speaks to {', '.join(people)}, not to {', '.join(ids_in(addressee))}"
                raise _illegal(fragment, "addressee", reason, "end the turn first")
        else:
            if status == "backchannel" and self.holds_the_turn:
                reason = "'backchannel' while the robot holds the turn"
                raise _illegal(fragment, "turn_status", reason, "end the turn first")
            if self._scene.open is not None:
                reason = f"{status!r} while turn {self._scene.open.turn} is open"
                raise _illegal(fragment, "turn_status", reason, "send its 'end' first")
            turn = fragment.id
        plan = plan_turn(fragment, turn, addressee)
        if self._scene.open is not None:
            # What is said before a question answers somebody, or nobody: the pair begins with the question.
            asks = plan.closes and fragment.turn_index == 1 and fragment.within is not None
            plan = replace(plan, announces_pair=asks and not self._scene.open.announces_pair)
            if plan.interruptible is None:
                plan = replace(plan, interruptible=self._scene.open.interruptible)
            if plan.interruptible_after is None:
                plan = replace(plan, interruptible_after=self._scene.open.interruptible_after)

        def amend(policy: TurnPolicy) -> None:
            nonlocal plan
            plan = checked("amended plan", policy.amended(plan, fragment), TurnPlan)

        self.policies.ask(amend)
        self._scene.live[fragment.id] = plan
        self._delay_target = fragment.delay_target if fragment.delay else ""
        if status == "beginning":
            self._scene.open, self._scene.speaker, self._scene.life, self._broken_off = plan, requester, life, None
        elif status == "end":
            self._scene.open = None
        self._scene.silent_since = None
        return plan

    def fragment_begins(self, turn: str) -> None:
        """Note that the block of a fragment of `turn` is on its way."""
        self._scene.begun.setdefault(turn, False)

    def rename(self, name: Callable[[str], str]) -> None:
        """Speak to people by other ids from now on. name: the new one of each."""
        self._scene.live = {id: renamed(plan, name) for id, plan in self._scene.live.items()}
        self._scene.open = self._scene.open and renamed(self._scene.open, name)
        self.interjections.rename(name)
        self.policies.ask(lambda policy: policy.rename(name))

    def turn_ended(self, turn: str, now: Seconds) -> None:
        """Note that a turn is over: its end was signalled. Its last block may go on for a moment."""
        if turn in self._scene.begun:
            self._scene.begun[turn] = True
            self.interjections.turn_over(turn, now, went_on=True)

    def fragment_ended(self, id: str, *, complete: bool, now: Seconds, why: Fault = _COMPLETE) -> Aborted | None:
        """End a fragment. Its turn is aborted unless the block was performed completely. why: it was not."""
        plan = self._scene.live.pop(id, None)
        if plan is None:
            return None
        if not complete:
            return self._abort(plan, why)
        if self._scene.open is not None and not self._scene.live:
            self._scene.silent_since = now
        self._forget()
        return None

    def rest_refused(self, fragment: TurnFragment, requester: str, why: Fault) -> Aborted | None:
        """End the open turn if its rest was refused, before it was accepted, for what has happened to somebody."""
        is_rest = fragment.turn_status in ("middle", "end") and requester == self._scene.speaker
        if self._scene.open is None or not is_rest or not why.cause:
            return None
        return self._abort(self._scene.open, _refused(fragment.id, why))

    def fragment_refused(self, id: str, now: Seconds, why: Fault = _COMPLETE) -> Aborted | None:
        """Take back a fragment that the realizer has refused.

        Its turn goes on for another fragment, unless this one began it, or something has happened to somebody (`why`
        has a cause): then the turn ends as if the fragment had failed a moment later.
        """
        plan = self._scene.live.get(id)
        if plan is None:
            return None
        other = self._scene.open is not None and self._scene.open.turn != plan.turn
        if plan.turn == id or other or why.cause:
            return self.fragment_ended(id, complete=False, now=now, why=_refused(id, why))
        self._scene.open = plan
        return self.fragment_ended(id, complete=True, now=now)

    @property
    def averted_to(self) -> str:
        """The entity at which the robot looks while its open turn pauses; "": it does not avert its gaze."""
        return self._delay_target if self._scene.open is not None and not self._scene.live else ""

    def feed(self, message: News, now: Seconds) -> None:
        """Take what people do."""
        self.policies.ask(lambda policy: policy.feed(message, now))

    @property
    def held(self) -> str:
        """The turn that waits, as until it is decided whether somebody interrupts it; "": none does."""
        return self.policies.first(lambda policy: checked("held", policy.held, str)) or ""

    def goes_on(self, fragment: str) -> bool:
        """True if a fragment has neither ended nor is its turn broken off."""
        return fragment in self._scene.live

    @property
    def _limits(self) -> dict[tuple[str, Hashable], Seconds]:
        """Times until which others may go on as they do, by policy and its name of them."""

        def limits(policy: TurnPolicy) -> dict[tuple[str, Hashable], Seconds]:
            told = policy.limits.items()
            return {(policy.name, each): checked("limit", at, float | int) for each, at in told}

        return {name: at for each in self.policies.ask(limits) for name, at in each.items()}

    @property
    def deadline(self) -> Seconds | None:
        return min((self._waits.standing(*each) for each in self._limits.items() - self._passed), default=None)

    def tick(self, now: Seconds) -> Aborted | None:
        """Abort the turn that a policy ends by `now`; None: none."""
        named = self._limits
        self._passed &= named.items()
        limits = {name: at for name, at in named.items() if (name, at) not in self._passed}
        for name in [name for name in self._waits if name not in limits]:
            self._waits.clear(name)
        for name, at in limits.items():
            self._waits.keep(name, at, now)
        due = [*iter(lambda: self._waits.due(now), None)]

        def ending(policy: TurnPolicy) -> EarlyEnd | None:
            own = [name for name in due if name[0] == policy.name]
            ended = checked("ending", policy.ending(now, [limit for _, limit in own]), EarlyEnd | None)
            if ended is None:
                self._passed.update((name, limits[name]) for name in own)
            return ended

        ended = self.policies.first(ending)
        return self._abort(*ended) if ended is not None else None

    def _abort(self, plan: TurnPlan, why: Fault) -> Aborted:
        self._broken_off = why
        if self._scene.open is not None and self._scene.open.turn == plan.turn:
            self._scene.open = None
            self._scene.silent_since = None
        ended = tuple(id for id, live in self._scene.live.items() if live.turn == plan.turn)
        for id in ended:
            del self._scene.live[id]
        is_known = self._scene.begun.get(plan.turn) is False
        self._forget()
        return Aborted(plan.turn, plan.addressee, ended, why, is_known, is_to_one=not plan.others)

    def _forget(self) -> None:
        """Drop what is known of turns that are over."""
        kept = {plan.turn for plan in self._scene.live.values()} | {self.open_turn}
        self._scene.begun = {turn: is_over for turn, is_over in self._scene.begun.items() if turn in kept}


def _refused(id: str, why: Fault) -> Fault:
    refused = f"{id} was refused"
    return why.following(refused, "") if why.reason else Fault(reason=refused)


def _illegal(fragment: TurnFragment, field: str, reason: str, advice: str) -> InputRefused:
    return InputRefused(Fault(reason=reason, where=f"{fragment.id}: $.{field}", line=fragment.line, advice=advice))
