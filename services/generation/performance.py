"""One fragment from its acceptance to its outcome: what runs, what it started, and when nothing of it is open."""

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
from engage_hri.services.generation.permits import Permits
from engage_hri.services.generation.pipeline import FragmentPlan
from engage_hri.services.generation.references.policy import Unreferable
from engage_hri.services.generation.turns.continuation import NO_CONTINUATION, Continuation
from engage_hri.services.generation.turns.events import TurnEvents
from engage_hri.services.generation.turns.policy import TurnPlan

AWAITED = ("directed_gaze", "mutual_facial_gaze")
"""Events that must be decided before the outcome. An adjacency pair may take as long as its answer."""
Looks = Gaze | GazeShift | HeadDirectionShift
"""What moves the head to look at something."""


class Ended(Struct, frozen=True):
    at: Seconds
    status: str
    spoken: tuple[SpokenText, ...] = ()
    replaced_by: str = ""
    fault: Fault | None = None


class FragmentPerformance:
    """block_id: of the request for its block."""

    def __init__(self, request: PerformFragment, fragment: TurnFragment, turn: TurnPlan, patience: Seconds) -> None:
        self.request = request
        self.fragment = fragment
        self.turn = turn
        self.block_id = ""
        self.plan: FragmentPlan | None = None
        self.accepted = False
        self.refusal: Fault | None = None
        """The realizer found the block impossible before the fragment was accepted: nothing has moved."""
        self.signalled_end = False
        """Has recognition been told that the turn is over?"""
        self._patience = patience
        self._considered: tuple[ReferenceChoice, ...] = ()
        self._tries = 0
        self._warnings: list[str] = []
        self._behaviors: dict[str, Behavior] = {}
        self._running: dict[str, Behavior] = {}
        self._gaze = ""
        """The behavior that holds the head."""
        self._started: set[str] = set()
        """Events to be decided."""
        self._closed: set[str] = set()
        """Those that the realizer has ended."""
        self._forbidden: set[str] = set()
        self._reached: set[tuple[str, str]] = set()
        self._ended: Ended | None = None

    def begin(self, plan: FragmentPlan) -> None:
        """Its block is to be sent; again, if what it referred to had ended when it came."""
        self._tries += 1
        self.block_id = f"{self.request.id}.block" + (f"-{self._tries}" if self._tries > 1 else "")
        self.plan = plan
        self._warnings = list(plan.warnings)
        self._behaviors = {behavior.id: behavior for behavior in plan.block.behaviors}

    def feed(self, progress: SyncPointProgress) -> None:
        """A sync point of this fragment's block."""
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
        """What holds the head now. A shift holds it until the block ends."""
        behavior = self._behaviors.get(self._gaze) if self._ended is None else None
        return behavior if isinstance(behavior, Looks) else None

    def goes_on_with(self, other: "FragmentPerformance") -> bool:
        """Is it another fragment of the same turn, and its block on its way or being performed?"""
        return self is not other and self.turn.turn == other.turn.turn and self.plan is not None and not self.is_over

    @property
    def continuation(self) -> Continuation:
        """What the turn's next fragment has to follow."""
        return (
            self.plan.continuation.pending(self.fragment.id, self._reached)
            if self.plan is not None
            else NO_CONTINUATION
        )

    @property
    def unsaid(self) -> frozenset[str]:
        """The objects that it was to refer to, and has not."""
        mentions = self.plan.mentions if self.plan is not None else ()
        said = {mention.object for mention in mentions if mention.by in self._reached}
        return frozenset(mention.object for mention in mentions) - said

    @property
    def moving(self) -> tuple[BlockBehavior, ...]:
        """Gazes and points that are not over, in order: they say where the body will be."""
        return tuple(
            behavior
            for behavior in (self.plan.block.behaviors if self.plan is not None else ())
            if isinstance(behavior, Looks | Pointing)
            and not {(behavior.id, "relax"), (behavior.id, "end")} & self._reached
        )

    def forbid(self, permits: Permits) -> tuple[str, ...]:
        """Behaviors under way that an inhibition forbids, each once."""
        ids = []
        for behavior in self._running.values():
            if permits.stops(behavior) and behavior.id not in self._forbidden:
                self._forbidden.add(behavior.id)
                ids.append(behavior.id)
        return tuple(ids)

    def end(
        self,
        at: Seconds,
        status: str,
        *,
        spoken: tuple[SpokenText, ...] = (),
        replaced_by: str = "",
        fault: Fault | None = None,
    ) -> None:
        """The block is over, or will never be. Only the first end counts."""
        if self._ended is None:
            self._ended = Ended(at, status, spoken, replaced_by, fault)
            self._running.clear()

    def fail(self, error: EngageError, at: Seconds) -> None:
        """There is no block, or it went wrong."""
        if isinstance(error, Unreferable):
            self._considered = error.choices
        self.end(at, "failed", fault=error.fault)

    def refuse(self, fault: Fault, at: Seconds) -> None:
        """Its block was. A fragment that had been accepted already has failed."""
        self.refusal = None if self.accepted else fault
        self.end(at, "failed", fault=fault)

    def end_with(self, outcome: BlockOutcome, at: Seconds) -> None:
        """What its realizer says. Where words were lost and not one was spoken the fragment was not performed."""
        given = zip_longest(outcome.dropped, outcome.reasons[: len(outcome.dropped)], fillvalue="")
        why = {id: reason.removeprefix(f"{id}: ") for id, reason in given}
        self._warnings += [f"{id} was dropped" + (f": {reason}" if reason else "") for id, reason in why.items()]
        self._started -= set(outcome.dropped)
        status, fault = outcome.status, outcome.fault
        if status == "done" and (silence := self._silence(outcome, why)) is not None:
            status, fault = "failed", silence
        self.end(at, status, spoken=outcome.spoken, replaced_by=outcome.replaced_by, fault=fault)

    def _silence(self, outcome: BlockOutcome, why: Mapping[str, str]) -> Fault | None:
        """Why nothing was said of a fragment with words; None if something was, or nobody wanted it any more."""
        unspoken = [id for id in why if isinstance(it := self._behaviors.get(id), Speech) and has_words(it.text)]
        if not unspoken or any(has_words(spoken.text) for spoken in outcome.spoken):
            return None
        reasons = "; ".join(dict.fromkeys(why[id] for id in unspoken if why[id])) or "see the block's warnings"
        lost = f"{', '.join(unspoken)} {'was' if len(unspoken) == 1 else 'were'} dropped"
        return Fault(reason=f"none of its words was spoken: {lost}: {reasons}", where=self.fragment.id)

    @property
    def is_over(self) -> bool:
        """Has the block ended? The outcome may have to wait for decisions."""
        return self._ended is not None

    @property
    def status(self) -> str:
        return self._ended.status if self._ended else ""

    @property
    def deadline(self) -> Seconds | None:
        """When to stop waiting for decisions."""
        return self._ended.at + self._patience if self._ended else None

    def outcome(self, events: TurnEvents, now: Seconds) -> FragmentOutcome | None:
        """None until the block has ended and every directed and facial gaze that it started is decided."""
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
            events=events.of(self.turn.turn),
            choices=self.plan.choices if self.plan else self._considered,
            warnings=(*self._warnings, *(f"{id} was never decided" for id in undecided)),
            fault=self._ended.fault,
        )

    def _decided(self, behavior: str, events: TurnEvents) -> bool:
        event = events.at(self.fragment.id, behavior)
        return behavior in self._closed if event is None else event.state != "started"


class GazesOfFragments:
    """Which gaze of a fragment has the head: of those that go on, the one that began last."""

    def __init__(self) -> None:
        self._gazes: dict[str, Looks | None] = {}
        """By request, in the order of their starts; None once it has ended and its block has not."""

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
    def rest(self) -> bool:
        """Does the block of one go on, whatever became of its gazes?"""
        return bool(self._gazes)
