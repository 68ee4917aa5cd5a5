"""One fragment from its acceptance to its outcome: what is under way, and which events it still waits for."""

from collections.abc import Mapping
from itertools import zip_longest

from msgspec import Struct

from engage_hri.schemas.behaviors import (
    Behavior,
    BlockBehavior,
    Event,
    Gaze,
    GazeShift,
    HeadDirectionShift,
    Pointing,
    Speech,
    TurnSignal,
)
from engage_hri.schemas.blocks import BlockOutcome, SpokenText
from engage_hri.schemas.faults import EngageError, Fault
from engage_hri.schemas.feedback import SyncPointProgress
from engage_hri.schemas.fragments import FragmentOutcome, PerformFragment, ReferenceChoice, TurnFragment
from engage_hri.schemas.speakable import has_words
from engage_hri.schemas.units import Seconds
from engage_hri.services.generation.block.emission import FragmentPlan
from engage_hri.services.generation.permits import Permits
from engage_hri.services.generation.references.policy import Unreferable
from engage_hri.services.generation.turns.continuation import NO_CONTINUATION, Continuation
from engage_hri.services.generation.turns.events import TurnEvents
from engage_hri.services.generation.turns.policy import TurnPlan

AWAITED = ("directed_gaze", "mutual_facial_gaze")
"""Events that must be decided before the outcome. An adjacency pair is not: a person's answer may take long."""
Looks = Gaze | GazeShift | HeadDirectionShift
"""Behaviors that move the head to look at something."""


class Ended(Struct, frozen=True):
    """The end of a fragment's block. at: local time."""

    at: Seconds
    status: str
    spoken: tuple[SpokenText, ...] = ()
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
        self.accepted = False
        self.refusal: Fault | None = None
        """Set when the realizer found the block impossible before the fragment was accepted: nothing has moved."""
        self.signalled_end = False
        """True once recognition has been told that the turn is over."""
        self._patience = patience
        self._considered: tuple[ReferenceChoice, ...] = ()
        self._tries = 0
        self._warnings: list[str] = []
        self._behaviors: dict[str, Behavior] = {}
        self._running: dict[str, Behavior] = {}
        self._gaze = ""
        """The behavior that holds the head."""
        self._started: set[str] = set()
        """Ids of the events that have started and that the outcome waits for."""
        self._closed: set[str] = set()
        """Ids of the behaviors and events that the realizer has ended."""
        self._forbidden: set[str] = set()
        self.lost_motions_only = False
        """True if it failed because nothing of its block could be performed, and it had no words."""
        self._reached: set[tuple[str, str]] = set()
        self._ended: Ended | None = None

    def begin(self, plan: FragmentPlan) -> None:
        """Take the plan whose block is sent next.

        Called again, and with another request id, when a block to which the first one refers had ended meanwhile.
        """
        self._tries += 1
        self.block_id = f"{self.request.id}.block" + (f"-{self._tries}" if self._tries > 1 else "")
        self.plan = plan
        self._warnings = list(plan.warnings)
        self._behaviors = {behavior.id: behavior for behavior in plan.block.behaviors}

    def feed(self, progress: SyncPointProgress) -> None:
        """Take a sync point of this fragment's block."""
        behavior = self._behaviors.get(progress.behavior)
        if behavior is None:
            return
        self._reached.add((behavior.id, progress.sync))
        if progress.sync == "start":
            self._running[behavior.id] = behavior
            if isinstance(behavior, Looks):
                self._gaze = behavior.id
            elif isinstance(behavior, Event) and behavior.kind in AWAITED:
                self._started.add(behavior.id)
            elif isinstance(behavior, TurnSignal) and behavior.signal == "ended":
                self.signalled_end = True
        elif progress.sync == "end":
            self._running.pop(behavior.id, None)
            self._closed.add(behavior.id)
            if self._gaze == behavior.id and isinstance(behavior, Gaze):
                self._gaze = ""

    @property
    def gaze(self) -> Looks | None:
        """The behavior that holds the head now, if there is one. A shift holds it until the block ends."""
        behavior = self._behaviors.get(self._gaze) if self._ended is None else None
        return behavior if isinstance(behavior, Looks) else None

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
    def unsaid(self) -> frozenset[str]:
        """Ids of the objects that the fragment was to refer to, and has not."""
        mentions = self.plan.mentions if self.plan is not None else ()
        said = {mention.object for mention in mentions if mention.by in self._reached}
        return frozenset(mention.object for mention in mentions) - said

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
        """Note that no block could be made or sent, or that it went wrong."""
        if isinstance(error, Unreferable):
            self._considered = error.choices
        self.end(Ended(at, "failed", fault=error.fault))

    def refuse(self, fault: Fault, at: Seconds) -> None:
        """Note that the realizer refused the block. A fragment that had been accepted already has failed."""
        self.refusal = None if self.accepted else fault
        self.end(Ended(at, "failed", fault=fault))

    def end_with(self, outcome: BlockOutcome, at: Seconds) -> None:
        """Take the outcome of the block. A fragment with words of which none was spoken has failed."""
        given = zip_longest(outcome.dropped, outcome.reasons[: len(outcome.dropped)], fillvalue="")
        why = {id: reason.removeprefix(f"{id}: ") for id, reason in given}
        self._warnings += [f"{id} was dropped" + (f": {reason}" if reason else "") for id, reason in why.items()]
        self._started -= set(outcome.dropped)
        status, fault = outcome.status, outcome.fault
        silence = self._silence(outcome, why)
        none_left = self._behaviors.keys() <= why.keys() and not any(it.required for it in self._behaviors.values())
        if silence is not None and (status == "done" or none_left):
            status, fault = "failed", silence
        self.lost_motions_only = status == "failed" and none_left and silence is None
        self.end(Ended(at, status, outcome.spoken, outcome.replaced_by, fault))

    def _silence(self, outcome: BlockOutcome, why: Mapping[str, str]) -> Fault | None:
        """Fault that names the dropped speeches of a fragment of which no word was spoken; None: there are none."""
        unspoken = [id for id in why if isinstance(it := self._behaviors.get(id), Speech) and has_words(it.text)]
        if not unspoken or any(has_words(spoken.text) for spoken in outcome.spoken):
            return None
        reasons = "; ".join(dict.fromkeys(why[id] for id in unspoken if why[id])) or "see the block's warnings"
        lost = f"{', '.join(unspoken)} {'was' if len(unspoken) == 1 else 'were'} dropped"
        return Fault(reason=f"none of its words was spoken: {lost}: {reasons}", where=self.fragment.id)

    @property
    def is_over(self) -> bool:
        """True once the block has ended. The outcome may still have to wait for events to be decided."""
        return self._ended is not None

    @property
    def status(self) -> str:
        return self._ended.status if self._ended else ""

    @property
    def deadline(self) -> Seconds | None:
        """Time when to stop waiting for events to be decided; None before the block has ended."""
        return self._ended.at + self._patience if self._ended else None

    def outcome(self, events: TurnEvents, now: Seconds) -> FragmentOutcome | None:
        """The outcome; None until the block has ended and its directed and facial gazes are decided, or too late."""
        if self._ended is None:
            return None
        undecided = [id for id in sorted(self._started) if not self._decided(id, events)]
        if undecided and self.deadline is not None and now < self.deadline:
            return None
        status = self._ended.status
        assert status in ("done", "failed", "interrupted")
        return FragmentOutcome(
            id=self.request.id,
            fragment=self.fragment.id,
            status=status,  # type: ignore[arg-type]
            spoken=self._ended.spoken,
            replaced_by=self._ended.replaced_by,
            events=events.of_turn(self.turn.turn),
            choices=self.plan.choices if self.plan else self._considered,
            warnings=(*self._warnings, *(f"{id} was never decided" for id in undecided)),
            fault=self._ended.fault,
        )

    def _decided(self, behavior: str, events: TurnEvents) -> bool:
        event = events.last_begun_by(self.fragment.id, behavior)
        return behavior in self._closed if event is None else event.state != "started"


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
