"""One fragment from its acceptance to its outcome: what is under way, and which events it still waits for."""

from collections.abc import Callable, Iterable, Mapping
from typing import Literal

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import (
    Behavior,
    BlockBehavior,
    Event,
    Gaze,
    Looks,
    Pointing,
    Speech,
    TurnSignal,
)
from engage_hri.schemas.blocks import BlockOutcome, SyncPointProgress
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.faults import EngageError, Fault, OutcomeUnknown
from engage_hri.schemas.fragments import FragmentOutcome, PerformFragment, ReferenceChoice, TurnFragment
from engage_hri.schemas.text import has_words
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.generation.acts import (
    Act,
    eye_contact,
    last_choices,
    reasons,
    references_made,
    rest_of,
    unsaid,
    unshown,
)
from engage_hri.services.generation.block.emission import FragmentPlan
from engage_hri.services.generation.inhibitions import Permits
from engage_hri.services.generation.references.policy import Unreferable
from engage_hri.services.generation.turns.continuation import NO_CONTINUATION, Continuation
from engage_hri.services.generation.turns.outcomes import TurnEvents
from engage_hri.services.generation.turns.plan import TurnPlan
from engage_hri.services.reports.same_people import renamed
from engage_hri.services.text.ear import is_spoken

MOST_TRIES = 5
"""Number of blocks after which the gestures of a reference that is to be chosen again are not tried any more."""
AWAITED = ("directed_gaze", "mutual_facial_gaze")
"""Events that must be decided before the outcome. An adjacency pair is not: a person's answer may take long."""


class Ended(Struct, frozen=True):
    """The end of a fragment's block. at: local time."""

    at: Seconds
    status: Literal["done", "failed", "interrupted", "unknown"]
    replaced_by: str = ""
    fault: Fault | None = None


class FragmentPerformance:
    """The state of a fragment that was taken: what of its block has been reached, and how it ended.

    block_id: id of the request for its block. accepted: the requester was told that the fragment is accepted.
    """

    def __init__(self, request: PerformFragment, fragment: TurnFragment, turn: TurnPlan, patience: Seconds) -> None:
        self.request = request
        self.fragment = fragment
        self.turn = turn
        self.block_id = ""
        self.plan: FragmentPlan | None = None
        """The plan of the block that is on its way or performed; None before, and between two blocks."""
        self.left, self.turn_left = fragment, turn
        """What has not been performed of fragment and turn: all, unless a reference is chosen again."""
        self.has_begun = False
        """True once it is not in line any more."""
        self.is_sent = False
        """True once the realizer has accepted the block of `plan`."""
        self.is_held = False
        """True while the block of `plan` waits, because somebody has spoken into it."""
        self.world: World | None = None
        """The world for which references were chosen, or found to be chosen still."""
        self.known: Mapping[str, Entity] = {}
        """What the fragment refers to, as it was when the fragment came."""
        self.barred: dict[str, dict[str, str]] = {}
        """Gestures, `gaze` and `point`, that failed for objects, and why: they are not chosen again."""
        self._unspoken: dict[str, str] = {}
        """Speeches that were dropped, and why."""
        self.acts: list[Act] = []
        """All blocks so far."""
        self.accepted = False
        self.refusal: Fault | None = None
        """Set when the realizer found the block impossible before the fragment was accepted: nothing has moved."""
        self.signalled_end = False
        """True once recognition has been told that the turn is over."""
        self._patience = patience
        self._considered: tuple[ReferenceChoice, ...] = ()
        self._tries = 0
        self._warnings: list[str] = []
        self._unpublished: list[str] = []
        self._behaviors: dict[str, Behavior] = {}
        self._running: dict[str, Behavior] = {}
        self._gaze = ""
        """The behavior that holds the head."""
        self._asked: dict[str, str] = {}
        """Ids of the events that the outcome waits for, each with the session of recognition that was asked."""
        self._closed: set[str] = set()
        """Ids of the behaviors and events that the realizer has ended."""
        self._forbidden: set[str] = set()
        self.lost_motions_only = False
        """True if it failed because nothing of its block could be performed, and it had no words."""
        self._ended: Ended | None = None

    def begin(self, plan: FragmentPlan) -> None:
        """Take the plan whose block is sent next."""
        self._tries += 1
        self.block_id = f"{self.request.id}.block" + (f"-{self._tries}" if self._tries > 1 else "")
        self.plan = plan
        self.acts.append(Act(plan))
        self.warn(plan.warnings)
        self._behaviors = {behavior.id: behavior for behavior in plan.block.behaviors}

    def warn(self, warnings: Iterable[str]) -> None:
        """Take warnings for the outcome, each once."""
        new = [each for each in dict.fromkeys(warnings) if each not in self._warnings]
        self._warnings += new
        self._unpublished += new

    def new_warnings(self) -> list[str]:
        """Return what `warn` has taken since this was last called."""
        new, self._unpublished = self._unpublished, []
        return new

    def feed(self, progress: SyncPointProgress, session: str) -> None:
        """Take a sync point of this fragment's block. session: of recognition now; empty: none is there."""
        behavior = self._behaviors.get(progress.behavior)
        if behavior is None:
            return
        self.acts[-1].reached.add((behavior.id, progress.sync))
        if progress.sync == "start":
            self._running[behavior.id] = behavior
            if isinstance(behavior, Looks):
                self._gaze = behavior.id
            elif isinstance(behavior, Event) and behavior.kind in AWAITED:
                self._asked[behavior.id] = session
            elif isinstance(behavior, TurnSignal) and behavior.signal == "ended":
                self.signalled_end = True
        elif progress.sync == "end":
            self._running.pop(behavior.id, None)
            self._closed.add(behavior.id)
            if self._gaze == behavior.id and isinstance(behavior, Gaze):
                self._gaze = ""

    def hear(self, word: WordSpoken) -> None:
        """Take a word that the voice has said."""
        if self.plan is not None:
            self.acts[-1].heard[word.behavior] = word.position

    @property
    def words_left(self) -> int:
        """Number of words of this block that the voice has not finished."""
        speeches = [each for each in self._behaviors.values() if isinstance(each, Speech)]
        heard = self.acts[-1].heard if self.acts else {}
        return sum(len(each.text[heard.get(each.id, 0) :].split()) for each in speeches)

    @property
    def _reached(self) -> set[tuple[str, str]]:
        return self.acts[-1].reached if self.acts else set()

    @property
    def may_choose_again(self) -> bool:
        """True while a reference may be chosen again: until then nobody knows what its words will be."""
        return not self.is_over and (self.plan is None or bool(self.acts[-1].open_hinges))

    @property
    def gaze(self) -> Looks | None:
        """The behavior that holds the head now, if there is one. A shift holds it until the block ends."""
        behavior = self._behaviors.get(self._gaze) if self._ended is None else None
        return behavior if isinstance(behavior, Looks) else None

    def rename(self, name: Callable[[str], str]) -> None:
        """Speak to people by other ids from now on. name: the new one of each."""
        self.fragment, self.turn = renamed(self.fragment, name), renamed(self.turn, name)
        self.left, self.turn_left = renamed(self.left, name), renamed(self.turn_left, name)

    def goes_on_with(self, other: "FragmentPerformance") -> bool:
        """True if this is another fragment of the same turn, and its block is on its way or being performed."""
        return self is not other and self.turn.turn == other.turn.turn and self.plan is not None and not self.is_over

    @property
    def continuation(self) -> Continuation:
        """The points of this block that are ahead, and that the turn's next fragment has to follow."""
        return (
            self.plan.continuation.pending(self.fragment.id, self._reached)
            if self.plan is not None
            else NO_CONTINUATION
        )

    @property
    def unmentioned(self) -> frozenset[str]:
        """Ids of the objects that the fragment was to refer to, and has not."""
        meant = [(made, made.by in act.reached) for act in self.acts for made in act.plan.made]
        said = {made.object for made, has_come in meant if has_come}
        return frozenset(made.object for made, _ in meant) - said

    @property
    def moving(self) -> tuple[BlockBehavior, ...]:
        """Gazes and points that have not relaxed or ended, in order: they tell where the body will be."""
        return tuple(
            behavior
            for behavior in (self.plan.block.behaviors if self.plan is not None else ())
            if isinstance(behavior, Looks | Pointing)
            and not {(behavior.id, "relax"), (behavior.id, "end")} & self._reached
        )

    def forbid(self, permits: Permits) -> tuple[str, ...]:
        """Ids of behaviors under way that the permits forbid; each is returned once."""
        ids = []
        for behavior in self._running.values():
            if permits.stops(behavior) and behavior.id not in self._forbidden:
                self._forbidden.add(behavior.id)
                ids.append(behavior.id)
        return tuple(ids)

    def end(self, ended: Ended) -> None:
        """Note that the block has ended, or that there will be none. Only the first call counts."""
        if self._ended is None:
            self._ended = ended
            self._running.clear()

    def fail(self, error: EngageError, at: Seconds) -> None:
        """Note that no block could be made or sent, or that nobody knows what became of it."""
        if isinstance(error, Unreferable):
            self._considered = error.choices
        is_unknown = isinstance(error, OutcomeUnknown)
        if is_unknown and self.plan is not None:
            self.acts[-1].spoken = self.acts[-1].said_so_far
        self.end(Ended(at, "unknown" if is_unknown else "failed", fault=error.fault))

    def refuse(self, fault: Fault, at: Seconds) -> None:
        """Note that the realizer refused the block. A fragment that had been accepted already has failed."""
        self.refusal = None if self.accepted else fault
        self.end(Ended(at, "failed", fault=fault))

    def end_with(self, outcome: BlockOutcome, at: Seconds) -> None:
        """Take the outcome of a block. If a reference is to be chosen again, the fragment goes on with `left`.

        A fragment with words of which none was spoken has failed.
        """
        act, why = self.acts[-1], reasons(outcome)
        act.spoken = outcome.spoken
        for id in (*outcome.dropped, *outcome.interrupted):
            self._asked.pop(id, None)
        rest = rest_of(self.left, self.turn_left, act, outcome) if self._may_go_on(outcome, why) else None
        # What fell with another behavior is not worth a word: that one is named.
        fallen = {each.id for each in act.plan.block.behaviors if {*each.needs} & {*why, *outcome.interrupted}}
        told = {id: reason for id, reason in why.items() if id not in fallen}
        self._unspoken |= {id: reason for id, reason in told.items() if self._speaks(id)}
        self._warnings += [f"{id} was dropped" + (f": {reason}" if reason else "") for id, reason in told.items()]
        if rest is not None:
            self.left, self.turn_left, self.plan, self.is_sent = rest.fragment, rest.turn, None, False
            self.is_held = False
            for object, reasons_why in rest.failed.items():
                self.barred.setdefault(object, {}).update(reasons_why)
                if self._tries >= MOST_TRIES:
                    self.barred[object] = dict.fromkeys(("gaze", "point"), "it has failed too often")
            self._running.clear()
            self._gaze = ""
            return
        status, fault = outcome.status, outcome.fault
        silence = self._silence()
        none_left = self._none_left(why)
        if silence is not None and (status == "done" or none_left):
            status, fault = "failed", silence
        self.lost_motions_only = status == "failed" and none_left and silence is None
        self.end(Ended(at, status, outcome.replaced_by, fault))

    def _none_left(self, why: Mapping[str, str]) -> bool:
        return self._behaviors.keys() <= why.keys() and not any(it.required for it in self._behaviors.values())

    def _may_go_on(self, outcome: BlockOutcome, why: Mapping[str, str]) -> bool:
        """True if the block ended by itself: because all came, or fell."""
        return outcome.status == "done" or (outcome.status == "failed" and self._none_left(why))

    def _speaks(self, id: str) -> bool:
        return isinstance(it := self._behaviors.get(id), Speech) and is_spoken(it.text)

    def _silence(self) -> Fault | None:
        """Fault that names the dropped speeches of a fragment of which no word was spoken; None: there are none."""
        if not self._unspoken or any(has_words(each.text) for act in self.acts for each in act.spoken):
            return None
        reasons = "; ".join(dict.fromkeys(filter(None, self._unspoken.values()))) or "see the block's warnings"
        lost = f"{', '.join(self._unspoken)} {'was' if len(self._unspoken) == 1 else 'were'} dropped"
        return Fault(reason=f"none of its words was spoken: {lost}: {reasons}", where=self.fragment.id)

    @property
    def is_over(self) -> bool:
        """True once the block has ended. The outcome may still have to wait for events to be decided."""
        return self._ended is not None

    @property
    def why(self) -> Fault:
        """Reason for the end of what belongs to the same turn."""
        status = f"{self.fragment.id} {self.status}"
        fault = self._ended.fault if self._ended else None
        return Fault(reason=status) if fault is None else replace(fault, reason=status)

    @property
    def status(self) -> str:
        return self._ended.status if self._ended else ""

    @property
    def deadline(self) -> Seconds | None:
        """Time when to stop waiting for events to be decided, as far as no one has stood still; None: none yet."""
        return self._ended.at + self._patience if self._ended else None

    def outcome(self, events: TurnEvents, *, is_due: bool) -> FragmentOutcome | None:
        """The outcome; None until the block has ended and its directed and facial gazes are decided, or it is due."""
        if self._ended is None:
            return None
        undecided = [id for id, session in self._asked.items() if not self._decided(id, session, events)]
        if undecided and not is_due:
            return None
        mine = [event for event in events.of_turn(self.turn.turn) if event.block == self.fragment.id]
        made = references_made(self.acts, mine)
        return FragmentOutcome(
            id=self.request.id,
            fragment=self.fragment.id,
            status=self._ended.status,
            spoken=tuple(each for act in self.acts for each in act.words),
            unsaid=unsaid(self.acts) if self.acts else self.fragment.worded,
            references=made,
            eye_contact=eye_contact(self.acts, mine),
            replaced_by=self._ended.replaced_by,
            events=events.of_turn(self.turn.turn),
            choices=last_choices(self.acts) or self._considered,
            warnings=(
                *self._warnings,
                *unshown(self.acts, made),
                *(f"{id} was never decided" for id in undecided),
            ),
            fault=self._ended.fault,
        )

    def _decided(self, behavior: str, session: str, events: TurnEvents) -> bool:
        """True if nothing more will be told of an event. session: of recognition when it was asked for it.

        What had not started when recognition died never will: its next life knows nothing of it.
        """
        event = events.last_begun_by(self.fragment.id, behavior)
        has_died = session not in ("", events.session)
        return behavior in self._closed or has_died if event is None else event.state != "started"


class GazesOfFragments:
    """The gazes of all fragments that are performed: of those that go on, the one that began last has the head."""

    def __init__(self) -> None:
        self._gazes: dict[str, Looks | None] = {}
        """By request, in the order of their starts; None where the gaze has ended and its block has not."""

    def follow(self, performance: FragmentPerformance) -> None:
        gaze, id = performance.gaze, performance.request.id
        if performance.is_over:
            self._gazes.pop(id, None)
        elif gaze is None and id in self._gazes:
            self._gazes[id] = None
        elif gaze is not None and gaze is not self._gazes.get(id):
            self._gazes.pop(id, None)
            self._gazes[id] = gaze

    @property
    def holder(self) -> Looks | None:
        return next((gaze for gaze in reversed(self._gazes.values()) if gaze is not None), None)

    @property
    def goes_on(self) -> bool:
        """True while the block of a fragment that has moved the head goes on, its gaze ended or not."""
        return bool(self._gazes)
