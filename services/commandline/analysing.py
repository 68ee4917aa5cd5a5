"""Recorded sessions in numbers: each recording as a record of the study, and recognition once more over it."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct, structs

from engage_hri.schemas import keys
from engage_hri.schemas.ledger import Taken
from engage_hri.schemas.messages import Message
from engage_hri.schemas.recognition import ConnectionEvent, Statistics, WindowStatistics
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.samples import Received
from engage_hri.services.console.follow import FOLLOWED
from engage_hri.services.recognition.again import Again, Lack, events_in, settings_of
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.statistics.tally import Tally
from engage_hri.services.recording.reading import Recording
from engage_hri.services.recording.tiers import messages
from engage_hri.services.recording.times import Times, moved
from engage_hri.services.study.records import EventRecord, SessionRecord
from engage_hri.services.study.records import Recording as Record

WINDOW: Seconds = 30.0
"""Window of a tally whose recent numbers nobody reads."""


class Session(Struct, frozen=True, kw_only=True):
    """A recording in numbers. participant: empty: not told. published: what recognition said itself in the end.

    doubts: what may be wrong with these numbers, in words.
    """

    path: Path
    condition: str
    participant: str
    record: SessionRecord
    events: tuple[EventRecord, ...]
    published: WindowStatistics | None
    doubts: tuple[str, ...]


def session(recording: Recording, number: int, condition: str) -> Session:
    """Take a recording's numbers: of all connection events that began in it, as recognition decided them.

    number: of the session, as in the tables. condition: under which it counts.
    """
    times, tally, record = Times(recording), Tally(WINDOW), Record(recording.robot)
    published: WindowStatistics | None = None
    lives, before = Counter[str](), 0
    known: dict[str, bool] = {}
    for received, at in messages(recording):
        message = received.message
        if keys.first(FOLLOWED, received.key) is None:
            continue
        if isinstance(message, ConnectionEvent):
            if received.past and message.id not in known:
                known[message.id] = False
            began = times.at(message.started, recording.duration)
            if not known.setdefault(message.id, began is not None and began >= 0):
                before += message.state == "started" or not lives[message.session]
                continue
            lives[message.session] += 1
            tally.feed(message)
        if isinstance(message, Statistics):
            published = message.session if message.actor == "" else published
            continue
        record(_in_time(message, times, at), max(0.0, at))
    end = Stamp("recording", recording.duration)
    record(Statistics(actor="", at=end, session=tally.session(), recent=WindowStatistics()), recording.duration)
    doubts = tuple(_doubts(recording, lives, sum(not counts for counts in known.values())))
    return Session(
        path=Path(recording.name), condition=condition, participant=recording.facts.get("participant", ""),
        record=record.session(session=number, condition=condition, seed=0),
        events=record.events(session=number, condition=condition), published=published, doubts=doubts,
    )  # fmt: skip


def _in_time(message: Message, times: Times, at: Seconds) -> Message:
    def instant(stamp: Stamp) -> Stamp:
        found = times.at(stamp, at)
        return Stamp("recording", at if found is None else found)

    told: Message = moved(message, instant)
    return told


def _doubts(recording: Recording, lives: Counter[str], before: int) -> Iterable[str]:
    if not recording.is_whole:
        yield f"the recorder did not end in order: the numbers are of the first {recording.duration:.0f} s"
    if recording.losses.total:
        yield f"{recording.losses.total} messages are missing"
    if recording.damaged:
        yield f"{len(recording.damaged)} damaged chunks are left out"
    if before:
        yield f"{before} events that began before the recording are not counted"
    if len(lives) > 1:
        often = "once" if len(lives) == 2 else f"{len(lives) - 1} times"
        yield f"recognition was restarted {often}: what was open then is lost"
    if not lives:
        yield "there is no connection event in it"


# -- recognition again ------------------------------------------------------------------------------------------


class Compared(Struct, frozen=True, kw_only=True):
    """One life of recognition, live and again. live, again: changes of events.

    sure: number of changes that have to be there live. What the last steps led to comes after them, and the recording
    may have ended, or recognition may have been killed, in between.
    """

    session: str
    live: tuple[ConnectionEvent, ...]
    again: tuple[ConnectionEvent, ...]
    lack: Lack
    sure: int

    @property
    def is_same(self) -> bool:
        return self.live == self.again[: len(self.live)] and len(self.live) >= self.sure

    def differences(self) -> list[tuple[ConnectionEvent | None, ConnectionEvent | None]]:
        """Changes that only one side has, or that differ: of one event and state together.

        If the first steps are missing, events are numbered otherwise again, and are known by what they are.
        """
        live, again = self._named(self.live), self._named(self.again)
        names = [*live, *(name for name in again if name not in live)]
        pairs = ((live.get(name), again.get(name)) for name in names)
        return [(one, other) for one, other in pairs if not self._is_one(one, other)]

    def _named(self, changes: Iterable[ConnectionEvent]) -> dict[tuple[object, ...], ConnectionEvent]:
        """Changes by their event, their state, and how often that was told before."""
        told = Counter[tuple[object, ...]]()
        named = dict[tuple[object, ...], ConnectionEvent]()
        for one in changes:
            event = (one.kind, one.initiator, one.responder, one.started) if self.lack.before else (one.id,)
            name = (*event, one.state)
            named[*name, told[name]] = one
            told[name] += 1
        return named

    def _is_one(self, one: ConnectionEvent | None, other: ConnectionEvent | None) -> bool:
        if self.lack.before and one is not None and other is not None:
            return structs.replace(one, id="") == structs.replace(other, id="")
        return one == other


Choose = Callable[[RecognitionConfig], RecognitionConfig]
"""Settings for recognition again, given those that it had."""


def again(recording: Recording, choose: Choose = lambda config: config) -> list[Compared]:
    """Recognize once more, each life of recognition for itself."""
    found: dict[str, tuple[Again, list[ConnectionEvent]]] = {}
    live: dict[str, list[ConnectionEvent]] = {}
    sure: dict[str, int] = {}
    numbers = _numbers(recording)

    def find(life: str, number: int) -> Received | None:
        place = numbers.get((life, number & 0xFFFFFFFF))
        return None if place is None else recording.received(place)

    for place in range(len(recording)):
        key = recording.key(place)
        if key != keys.TAKEN and not keys.matches(keys.ANY_CONNECTION_EVENT, key):
            continue
        message = getattr(recording.received(place), "message", None)
        if isinstance(message, ConnectionEvent):
            live.setdefault(message.session, []).append(message)
        elif isinstance(message, Taken):
            if message.session not in found:
                config = choose(settings_of(message) or RecognitionConfig())
                found[message.session] = (Again(recording.robot, message.session, message.at.clock, config), [])
            life, events = found[message.session]
            sure[message.session] = len(events)
            events += events_in(life.take(message, find))
    return [
        Compared(session=name, live=tuple(live.get(name, ())), again=tuple(events), lack=life.lack, sure=sure[name])
        for name, (life, events) in found.items()
    ]


def _numbers(recording: Recording) -> dict[tuple[str, int], int]:
    """Places of the ordered events and states, by life and number."""
    found = {}
    for place in range(len(recording)):
        key = recording.key(place)
        if key and keys.key_class(key) in ("evt", "state"):
            life, number = recording.life(place), recording.number(place)
            if number:
                found[life, number] = place
    return found


def with_settings(config: RecognitionConfig, settings: Sequence[str]) -> RecognitionConfig:
    """The same with other settings, `recognition.KEY=VALUE`. Raises InputRefused."""
    from engage_hri.services.commandline.config import load

    return load(settings=settings, defaults=_flat(msgspec.to_builtins(config), "recognition")).recognition


def _flat(values: dict[str, Any], name: str) -> list[str]:
    found: list[str] = []
    for key, value in values.items():
        if isinstance(value, dict):
            found += _flat(value, f"{name}.{key}")
        elif value is not None:
            found.append(f"{name}.{key}={msgspec.json.encode(value).decode()}")
    return found
