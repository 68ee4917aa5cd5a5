"""One fragment from its acceptance to its outcome: what runs, what it started, and when nothing of it is open."""

from collections.abc import Iterable

from msgspec import Struct

from schemas.behaviors import Behavior, Event, Gaze, GazeShift, Hand, HeadDirectionShift, Pointing, TurnSignal
from schemas.blocks import BlockOutcome, SpokenText
from schemas.faults import Fault
from schemas.feedback import SyncPointProgress
from schemas.fragments import FragmentOutcome, PerformFragment, TurnFragment
from schemas.recognition import ConnectionEvent
from schemas.units import Seconds
from services.generation.planning import Plan
from services.generation.turn_policy import TurnPlan

AWAITED = ("directed_gaze", "mutual_facial_gaze")
"""Events that must be decided before the outcome. An adjacency pair may take as long as its answer."""


class TurnEvents:
    """The connection events of the robot's turns in their last known state."""

    def __init__(self) -> None:
        self._events: dict[str, ConnectionEvent] = {}
        self._turn_of: dict[str, str] = {}
        """Which turn each block belongs to."""

    def expect(self, block: str, turn: str) -> None:
        self._turn_of[block] = turn

    def feed(self, event: ConnectionEvent) -> None:
        # What is first heard of in a later state belongs to an earlier performance under the same id.
        if event.block in self._turn_of and (event.state == "started" or event.id in self._events):
            self._events[event.id] = event

    def of(self, turn: str) -> tuple[ConnectionEvent, ...]:
        """By start."""
        events = [event for event in self._events.values() if self._turn_of[event.block] == turn]
        return tuple(sorted(events, key=lambda event: event.started.seconds))

    def at(self, block: str, behavior: str) -> ConnectionEvent | None:
        mine = (event for event in reversed(self._events.values()) if event.block == block)
        return next((event for event in mine if event.behavior == behavior), None)

    def forget(self, turns: Iterable[str]) -> None:
        """Keep only these turns."""
        kept = set(turns)
        self._turn_of = {block: turn for block, turn in self._turn_of.items() if turn in kept}
        self._events = {id: event for id, event in self._events.items() if event.block in self._turn_of}


class Ended(Struct, frozen=True):
    at: Seconds
    status: str
    spoken: tuple[SpokenText, ...] = ()
    replaced_by: str = ""
    fault: Fault | None = None


class Performance:
    """block_id: of the request for its block. Its body requests are called `<block_id>/<behavior>`."""

    def __init__(self, request: PerformFragment, fragment: TurnFragment, turn: TurnPlan, patience: Seconds) -> None:
        self.request = request
        self.fragment = fragment
        self.turn = turn
        self.block_id = f"{request.id}.block"
        self.plan: Plan | None = None
        self.accepted = False
        self.refusal: Fault | None = None
        """The realizer found the block impossible before the fragment was accepted: nothing has moved."""
        self.signalled_end = False
        """Has recognition been told that the turn is over?"""
        self._patience = patience
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
        self._ended: Ended | None = None

    def begin(self, plan: Plan) -> None:
        self.plan = plan
        self._warnings += plan.warnings
        self._behaviors = {behavior.id: behavior for behavior in plan.block.behaviors}

    def feed(self, progress: SyncPointProgress) -> None:
        """A sync point of this fragment's block."""
        behavior = self._behaviors.get(progress.behavior)
        if behavior is None:
            return
        if progress.sync == "start":
            self._running[behavior.id] = behavior
            if isinstance(behavior, Gaze | GazeShift | HeadDirectionShift):
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
    def gaze(self) -> Gaze | GazeShift | HeadDirectionShift | None:
        """What holds the head now. A shift holds it until the block ends."""
        behavior = self._behaviors.get(self._gaze) if self._ended is None else None
        return behavior if isinstance(behavior, Gaze | GazeShift | HeadDirectionShift) else None

    def forbid(self, *, gaze: bool, hands: tuple[Hand, ...]) -> tuple[str, ...]:
        """Body requests under way that an inhibition forbids, each once. gaze, hands: what is still allowed."""
        ids = []
        for behavior in self._running.values():
            looks = isinstance(behavior, Gaze | GazeShift | HeadDirectionShift)
            points = isinstance(behavior, Pointing) and not (behavior.mode in hands or (hands and not behavior.mode))
            if ((looks and not gaze) or points) and behavior.id not in self._forbidden:
                self._forbidden.add(behavior.id)
                ids.append(f"{self.block_id}/{behavior.id}")
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

    def refuse(self, fault: Fault, at: Seconds) -> None:
        """Its block was. A fragment that had been accepted already has failed."""
        self.refusal = None if self.accepted else fault
        self.end(at, "failed", fault=fault)

    def end_with(self, outcome: BlockOutcome, at: Seconds) -> None:
        self._warnings += [f"{behavior} was dropped" for behavior in outcome.dropped]
        self._started -= set(outcome.dropped)
        self.end(at, outcome.status, spoken=outcome.spoken, replaced_by=outcome.replaced_by, fault=outcome.fault)

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
            choices=self.plan.choices if self.plan else (),
            warnings=(*self._warnings, *(f"{id} was never decided" for id in undecided)),
            fault=self._ended.fault,
        )

    def _decided(self, behavior: str, events: TurnEvents) -> bool:
        event = events.at(self.fragment.id, behavior)
        return behavior in self._closed if event is None else event.state != "started"
