"""Sessions of two people, drawn from Table 2.1: observations for recognition, and the events they should make.

    plan = draw(random.Random(seed))
    for observation, at in observations(plan): ...

Pure. The explainer sits in the robot's place and begins events by requests, which can set a time limit; the events of
the listener are only seen. So backchannels are the listener's, and so are failures to look or to answer, for only a
request can set their delay.

A Poisson stream with the table's mean almost never pauses for 70 s. So there are two regimes: engaged, and busy,
while the listener carries out a detailed task after a request and hardly answers anything else (thesis 2.3).
"""

from collections.abc import Iterable, Iterator, Sequence
from random import Random

import msgspec
from msgspec import Struct

from engage_hri.schemas.behaviors import Action, Event, EventKind, TurnSignal
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound
from engage_hri.schemas.recognition import RequestEvent, SignalTurn
from engage_hri.schemas.units import Probability, Seconds, Stamp
from engage_hri.schemas.world import Entity, World
from tests.tangram.people.table_2_1 import TABLE

Observation = World | ActorFound | ActionBegan | ActionEnded | RequestEvent | SignalTurn

EXPLAINER, LISTENER = "robot", "human"
CLOCK = "loop"
"""Clock of the stamps."""
OBJECTS = ("cracker", "knife", "cheese", "olives", "peppers", "plate", "salmon")
"""Objects of directed gazes, used in turn, so that none comes again while its last time still counts."""
SHARED: Seconds = 0.5
"""Length of the shared phase of a gaze, once both look there."""
TURN: tuple[Seconds, Seconds] = (0.6, 1.8)
"""Range of the length of a pair's first turn, uniform; but at most half the delay of a pair that fails."""
ANSWER: Seconds = 0.6
"""Length of the second turn of an adjacency pair."""
LEAD: Seconds = 0.5
"""Time for which the explainer has been speaking when a backchannel comes."""
THIRD_TURN: Seconds = 1.6
"""Time after the answer until the asker's next words can no longer be the third turn of that pair (1.5 s)."""
GOES_ON: tuple[Seconds, Seconds] = (0.02, 0.08)
"""Beginning and end of the explainer's "well" after a pair failed: what the listener says then is no late answer."""
BETWEEN: Seconds = 0.6
"""Least time from the end of an event to the start of the next; longer than `LEAD`."""


class Pace(Struct, frozen=True, kw_only=True):
    """Pace of the events. The defaults give a mean of 5.7 s and a longest gap of about 70 s in nine minutes."""

    pause: Seconds = 2.15
    """Engaged: mean time from the end of an event to the next (exponential), beyond the least time."""
    detailed: Probability = 0.13
    """Share of the explainer's answered adjacency pairs that are answered by a detailed task: the busy regime."""
    busy: tuple[Seconds, Seconds] = (25.0, 85.0)
    """Busy: range of the time between two starts, uniform."""
    busy_lasts: Probability = 0.3
    """Probability that the task is not yet done when the next event begins."""
    busy_answers: Probability = 0.25
    """Busy: factor on the table's success rates."""


class Planned(Struct, frozen=True, kw_only=True):
    """A planned event.

    delay: of a failed event from its start, of an answered pair from the end of its first turn (`turn` seconds long);
    None for backchannels. task_until: end of the manipulation that answers this pair.
    """

    kind: EventKind
    initiator: str
    start: Seconds
    succeeds: bool
    delay: Seconds | None = None
    turn: Seconds = 0.0
    object: str = ""
    task_until: Seconds | None = None

    @property
    def by_explainer(self) -> bool:
        return self.initiator == EXPLAINER

    @property
    def decided(self) -> Seconds:
        """Time at which the responder begins, or fails to."""
        return self.start + (self.turn if self.succeeds else 0.0) + (self.delay or 0.0)

    @property
    def over(self) -> Seconds:
        """Time from which on the next event may be prepared."""
        if self.kind != "adjacency_pair":
            return self.decided + SHARED
        answered = self.decided + ANSWER if self.succeeds else self.decided
        return answered if self.by_explainer else answered + THIRD_TURN


# -- the plan ---------------------------------------------------------------------------------------------------


USUAL = Pace()


def draw(chance: Random, pace: Pace = USUAL) -> tuple[Planned, ...]:
    """Draw a session with as many events of each kind as the table has, in random order."""
    kinds = [kind for kind, row in TABLE.items() for _ in range(row.count)]
    chance.shuffle(kinds)
    plan: list[Planned] = []
    task: int | None = None
    """Index of the event whose answer keeps the listener busy."""
    start = 1.0
    while kinds:
        busy = task is not None
        event = _event(_next_kind(kinds, busy=busy), len(plan), start, chance, pace.busy_answers if busy else None)
        plan.append(event)
        may_be_task = event.kind == "adjacency_pair" and event.by_explainer and event.succeeds and not busy
        if may_be_task and chance.random() < pace.detailed:
            task = len(plan) - 1
        if task is None:
            start = event.over + BETWEEN + chance.expovariate(1 / pace.pause)
            continue
        start += chance.uniform(*pace.busy)
        if not kinds or chance.random() >= pace.busy_lasts:
            plan[task] = msgspec.structs.replace(plan[task], task_until=start - BETWEEN)
            task = None
    return tuple(plan)


def _next_kind(kinds: list[EventKind], *, busy: bool) -> EventKind:
    """Take the first kind; for a busy listener the first that is no backchannel, if there is one."""
    index = next((index for index, kind in enumerate(kinds) if not (busy and kind == "backchannel")), 0)
    return kinds.pop(index)


def _event(kind: EventKind, number: int, start: Seconds, chance: Random, answers: Probability | None) -> Planned:
    """Draw an event. answers: share of answers of a busy listener, who begins no event either; None if engaged."""
    row = TABLE[kind]
    succeeds = kind == "backchannel" or chance.random() < row.success * (1.0 if answers is None else answers)
    only_explainer = answers is not None or kind == "backchannel" or (not succeeds and kind != "mutual_facial_gaze")
    by_explainer = only_explainer or chance.random() < 0.5
    delay = None if kind == "backchannel" else (row.delays if succeeds else row.failed_delays).draw(chance)
    turn = chance.uniform(*TURN) if kind == "adjacency_pair" else 0.0
    return Planned(
        kind=kind, initiator=EXPLAINER if by_explainer else LISTENER, start=start, succeeds=succeeds, delay=delay,
        turn=turn if succeeds or delay is None else min(turn, delay / 2),  # it ends before the pair fails
        object=OBJECTS[number % len(OBJECTS)] if kind == "directed_gaze" else "",
    )  # fmt: skip


# -- its observations -------------------------------------------------------------------------------------------


def observations(plan: Sequence[Planned]) -> list[tuple[Observation, Seconds]]:
    """Observations of the session, in order, each with its time."""
    seen = [*_arrival()]
    for number, event in enumerate(plan, start=1):
        seen += _PlannedObservations(event, number).all()
    return sorted(seen, key=lambda observation: observation[1])


def _arrival() -> Iterator[tuple[Observation, Seconds]]:
    things = (Entity(id=name, kind="object", position=(0.6, 0.1 * y - 0.3, 0.7)) for y, name in enumerate(OBJECTS))
    table = Entity(id="table", kind="surface", position=(0.6, 0.0, 0.7))
    listener = Entity(id=LISTENER, kind="person", position=(1.3, 0.0, 1.2))
    yield World(entities=(table, *things, listener), at=Stamp(CLOCK, 0.0)), 0.0
    yield ActorFound(actor=LISTENER, at=Stamp(CLOCK, 0.0)), 0.0


class _PlannedObservations:
    """Observations of one planned event. Gazes come from and go back to nowhere."""

    def __init__(self, event: Planned, number: int) -> None:
        self._event = event
        self._number = number

    def all(self) -> Iterable[tuple[Observation, Seconds]]:
        match self._event.kind:
            case "directed_gaze":
                return self._gaze(self._event.object, self._event.object)
            case "mutual_facial_gaze":
                return self._gaze(self._other(self._event.initiator), self._event.initiator)
            case "adjacency_pair":
                return self._adjacency_pair()
            case "backchannel":
                return self._backchannel()

    def _gaze(self, target: str, answer: str) -> Iterator[tuple[Observation, Seconds]]:
        """The initiator looks at `target`, the responder (if at all) at `answer`."""
        event = self._event
        initiator, responder = event.initiator, self._other(event.initiator)
        if event.by_explainer:
            yield self._request()
        # Without an answer the initiator looks away: the listener at once, the explainer once its request has failed.
        gives_up = event.decided + (SHARED if event.succeeds or event.by_explainer else 0.0)
        yield from self._does(initiator, "look", event.start, gives_up, target)
        if event.kind == "directed_gaze" and not event.by_explainer:
            yield from self._does(initiator, "point", event.start, gives_up, target)
        if event.succeeds:
            yield from self._does(responder, "look", event.decided, event.decided + SHARED, answer)

    def _adjacency_pair(self) -> Iterator[tuple[Observation, Seconds]]:
        event = self._event
        turn_ends = event.start + event.turn
        if event.by_explainer:
            yield self._request()
        yield from self._does(event.initiator, "speak", event.start, turn_ends)
        if event.by_explainer:
            ended = TurnSignal(id="ended", turn=self._name, signal="ended", actor=LISTENER)
            yield (
                SignalTurn(id=f"{self._name}-ended", requester=EXPLAINER, signal=ended, at=self._at(turn_ends)),
                turn_ends,
            )
        if not event.succeeds:
            since, until = GOES_ON
            yield from self._does(EXPLAINER, "speak", event.decided + since, event.decided + until)
            return
        responder = self._other(event.initiator)
        if event.task_until is not None:
            yield from self._does(responder, "act", event.decided, event.task_until, OBJECTS[0])
        else:
            answer: Action = "nod" if event.by_explainer and self._number % 3 == 0 else "speak"
            yield from self._does(responder, answer, event.decided, event.decided + ANSWER)

    def _backchannel(self) -> Iterator[tuple[Observation, Seconds]]:
        """A nod, or a brief word, while the explainer speaks."""
        event = self._event
        yield from self._does(EXPLAINER, "speak", event.start - LEAD, event.start + SHARED)
        sign: Action = "nod" if self._number % 2 else "speak"
        yield from self._does(LISTENER, sign, event.start, event.start + SHARED / 2)

    def _request(self) -> tuple[Observation, Seconds]:
        event = self._event
        wanted = Event(
            id="event", kind=event.kind, responder=LISTENER, objects=(event.object,) if event.object else (),
            limit=None if event.succeeds else event.decided - event.start - event.turn,
            turn=self._name if event.turn else "",
            accept=() if event.task_until is None else ("act",),
        )  # fmt: skip
        request = RequestEvent(
            id=self._name, requester=EXPLAINER, block=self._name, event=wanted, at=self._at(event.start)
        )
        return request, event.start

    def _does(
        self, actor: str, action: Action, since: Seconds, until: Seconds, target: str = ""
    ) -> Iterator[tuple[Observation, Seconds]]:
        targets = (target,) if target else ()
        yield ActionBegan(actor=actor, action=action, targets=targets, at=self._at(since)), since
        yield ActionEnded(actor=actor, action=action, targets=targets, at=self._at(until)), until

    def _at(self, at: Seconds) -> Stamp:
        return Stamp(CLOCK, at)

    @property
    def _name(self) -> str:
        return f"event-{self._number}"

    @staticmethod
    def _other(actor: str) -> str:
        return LISTENER if actor == EXPLAINER else EXPLAINER
