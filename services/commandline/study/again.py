"""Services once more, over a recording: each takes what its ledger says that it took, and is to do the same.

A change of the code may change what a robot does, and no test has all the sessions that people have had with it. A
recorded session that is done once more tells whether it would go as it went; or, with other settings, what those
would have made of the same people.

A service with an intake is asked step by step, and the fingerprint of what follows from each step has to be that of
the ledger (`SERVICES`: a new service is a row). The realizer has none, and runs as it is.

It decides in tasks that await sync points (docs/realizer.md). At each instant of its ledger it gets what it got, on a
clock that jumps and at a bus that is played, and what it publishes is held against what the recording has of it. Its
timers fire to the instant then, and some milliseconds late when it lived; so times count as the same if they are
within `NEAR`, and the greatest difference is told. Of two inputs in one instant, which only a virtual clock has, all
that follows from the first comes before the second; when it lived, the second may have come between, and a command
that is void at once may have been sent or not.
"""

import asyncio
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
from msgspec import Struct
from msgspec.structs import replace
from rich.console import Console

from engage_hri.schemas import keys
from engage_hri.schemas.advice import explained
from engage_hri.schemas.blocks import PredictionFeedback, SyncPointProgress
from engage_hri.schemas.body import EstimateBehaviors, PerformBehavior
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.messages import Message, in_form
from engage_hri.schemas.participants import BusHealth, Step, Taken
from engage_hri.schemas.recognition import ConnectionEvent, session_of
from engage_hri.schemas.requests import KeepAlive
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.interface import Answer, Bus, Subscription, Tap
from engage_hri.services.bus.samples import Received
from engage_hri.services.commandline.shell.process import DONE
from engage_hri.services.commandline.shell.recording_file import opened
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.serving.intake import ControlIntake
from engage_hri.services.control.serving.steps import ControlStep
from engage_hri.services.generation import intake as generation
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.realizer.together.planning import BodyAnswered, RealizerInput, behaviors_asked
from engage_hri.services.recognition import intake as recognition
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recording.reading import Recording
from engage_hri.services.recording.settings import flat, settings_of
from engage_hri.services.runtime.configuration import read
from engage_hri.services.runtime.intake import (
    Again,
    Find,
    Lack,
    PublishMessage,
    ServiceIntake,
    StepClock,
    StepDifference,
    content_of,
)
from engage_hri.services.runtime.virtual_time import run_virtual

# -- the realizer -------------------------------------------------------------------------------------------------


TURNS = 40
"""Turns of the loop from one input to the next of the same instant: what follows from the first comes before."""
AFTER: Seconds = 0.01
"""Time for which it runs on after its last input."""


class SentMessage(Struct, frozen=True):
    """A message that the realizer published. at: on its clock, or that of the recording."""

    key: str
    message: Message
    at: Seconds


class PlayedBus(Bus):
    """The bus of a participant to whom a ledger is played. said: what it has published, in order."""

    def __init__(self, robot: str, name: str, run: str, clock: StepClock, lives: Iterator[int]) -> None:
        super().__init__(robot, name, "", clock.name, run, lives)
        self.said: list[SentMessage] = []
        self._known = clock
        self._asked = defaultdict[str, list[asyncio.Future[BodyAnswered]]](list)
        """Questions without an answer, and answers without a question, by what they are about, in order."""

    def give(self, received: Received) -> None:
        """Hand it a message."""
        for reader in self._readers:
            if isinstance(reader, Subscription) and reader.wants(received.key):
                reader.offer(received)

    def give_answer(self, answered: BodyAnswered) -> None:
        """Answer a question of it, or the one that it asks next."""
        open_ones = [each for each in self._asked[answered.asked] if not each.done()]
        (open_ones[0] if open_ones else self._asking(answered.asked)).set_result(answered)

    def _asking(self, asked: str) -> "asyncio.Future[BodyAnswered]":
        self._asked[asked].append(future := asyncio.get_running_loop().create_future())
        return future

    async def _query(self, key: str, message: Message, deadline: Seconds) -> Message | None:
        assert isinstance(message, EstimateBehaviors)
        name = behaviors_asked(message)
        answered = [each for each in self._asked[name] if each.done()]
        answer = answered[0] if answered else self._asking(name)
        try:
            await asyncio.wait([answer], timeout=deadline - self.now())
        finally:
            self._asked[name].remove(answer)
        if not answer.done():
            return None
        if (refused := answer.result().refused) is not None:
            raise InputRefused(refused)
        return answer.result().answer

    def _send(self, key: str, message: Message) -> None:
        in_form(key, message, "msgpack")  # as on a wire: what has no form raises
        self.said.append(SentMessage(key, message, self.now()))

    def local(self, stamp: Stamp) -> Seconds:
        return self._known.local(stamp, self.now())

    def error(self, clock: str) -> Seconds:
        return self._known.error(clock)

    @property
    def health(self) -> BusHealth:
        return BusHealth(peers=tuple(keys.SERVICES))

    def withdraw(self, *states: str) -> None:
        pass

    def is_heard(self, key: str) -> bool:
        return False

    def _attach(self, reader: Subscription | Tap) -> None:
        pass

    def _detach(self, reader: Subscription | Tap) -> None:
        pass

    def answer(self, key: str, answer: Answer, *, empty: Message | None = None) -> None:
        pass

    def declare_alive(self) -> None:
        pass

    async def leave(self) -> None:
        for reader in list(self._readers):
            reader.close()


async def _play(bus: PlayedBus, steps: Sequence[Step], clock: StepClock, find: Find, config: RealizerConfig) -> int:
    """Run the realizer over the steps. Returns the number of messages that are missing in the recording."""
    missing, loop = 0, asyncio.get_running_loop()
    task = asyncio.create_task(realize(bus, lambda: None, config))
    for _ in range(TURNS):
        await asyncio.sleep(0)
    for step, following in zip(steps, (*steps[1:], None), strict=True):
        clock.read(step.clocks)
        if step.now > bus.now():
            due = loop.create_future()
            loop.call_at(step.now, partial(due.set_result, None))
            await due
        if step.content is None:
            found = find(step.life, step.number)
        elif isinstance(content := content_of(step, RealizerInput), BodyAnswered):
            bus.give_answer(content)
            found = None
        else:
            found = Received(step.key, content, step.source, step.now, step.past, step.life)
        if found is not None:
            bus.give(replace(found, at=step.now if step.at is None else step.at, past=step.past))
        missing += found is None and step.content is None
        for _ in range(0 if following is not None and following.is_same_turn else TURNS):
            await asyncio.sleep(0)
    await asyncio.sleep(AFTER)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    await bus.leave()
    return missing


def played(
    robot: str, run: str, steps: Sequence[Step], clock: StepClock, find: Find, config: RealizerConfig
) -> tuple[list[SentMessage], int]:
    """Messages that the realizer publishes once more, and the number of those missing that it took.

    run: its life. steps: all of that life, from the first on.
    """

    async def play() -> tuple[list[SentMessage], int]:
        bus = PlayedBus(robot, "realizer", run, clock, iter(range(1, 1 << 30)))
        missing = await _play(bus, steps, clock, find, config)
        return bus.said, missing

    return run_virtual(play(), begin=steps[0].now)


# -- all services -------------------------------------------------------------------------------------------------


DIFFERENT = 1
"""Exit code if a service does something else with the same settings, and nothing is missing."""
SHOWN = 10
"""Messages that differ that are printed."""
NEAR: Seconds = 0.05
"""Greatest difference of times that count as the same for the realizer, whose timers were late when it lived: a loop
that is so late has stood still (`bus/deadlines.py`)."""


class PlayedService(NamedTuple):
    """A service that can be played to.

    make: its intake, given the robot, its configuration, its clocks and its session. content: type of what it takes.
    """

    config: type[Struct]
    make: Callable[[str, Any, StepClock, str], ServiceIntake]
    content: Any


SERVICES = {
    "control": PlayedService(
        ControlConfig, lambda robot, config, clock, session: ControlIntake(robot, config, clock.name), ControlStep
    ),
    "generation": PlayedService(GenerationConfig, generation.GenerationIntake, generation.Content),
    "recognition": PlayedService(RecognitionConfig, recognition.Intake, recognition.Content),
}
CONFIGS: dict[str, type[Struct]] = {
    "realizer": RealizerConfig, **{name: service.config for name, service in SERVICES.items()}
}  # fmt: skip
"""Services that can be played to, and the type of the configuration of each."""


class OtherWords(Struct, frozen=True):
    """A message that only one side has, or that says something else. None: that side has none."""

    live: SentMessage | None
    again: SentMessage | None


class Compared(Struct, frozen=True, kw_only=True):
    """One life of a service, live and again. differences: steps that led to something else again, in order.

    live, again: connection events as recognition published them; all that the realizer published; else nothing.
    other_words: those of them that say something else, and furthest: greatest difference of times of all others.
    """

    service: str
    session: str
    steps: int
    lack: Lack
    differences: tuple[StepDifference, ...] = ()
    live: tuple[SentMessage, ...] = ()
    again: tuple[SentMessage, ...] = ()
    other_words: tuple[OtherWords, ...] = ()
    furthest: Seconds = 0.0

    @property
    def is_same(self) -> bool:
        return not self.differences and not self.other_words


def again(
    recording: Recording, settings: Sequence[str] = (), services: Iterable[str] = tuple(CONFIGS)
) -> list[Compared]:
    """Play it to each life of these services once more; with settings, `SERVICE.KEY=VALUE`, to those alone.

    The realizer runs on an event loop, so nobody may ask for it on another one.
    Raises InputRefused: there is no such setting, or this Engage does not know those that the service had.
    """
    meant = {line.partition(".")[0] for line in settings} or {*services}
    configs = _configurations(recording)
    ledgers: dict[tuple[str, str], list[Taken]] = {}
    places: dict[tuple[str, int], int] = {}
    """Places of the ordered events and states, by life and number."""
    for place in range(len(recording)):
        key = recording.key(place)
        if not key or keys.key_class(key) not in ("evt", "state"):
            continue
        if number := recording.number(place):
            places[recording.life(place), number] = place
        if keys.matches(keys.ANY_TAKEN, key):
            taken = getattr(recording.received(place), "message", None)
            if isinstance(taken, Taken) and taken.service in meant & CONFIGS.keys():
                ledgers.setdefault((taken.service, taken.session), []).append(taken)

    def find(life: str, number: int) -> Received | None:
        place = places.get((life, number & 0xFFFFFFFF))
        return None if place is None else recording.received(place)

    found = []
    for (service, session), ledger in ledgers.items():
        had = configs.get((service, session))
        config, lack = _config(service, had, settings), Lack(settings=had is None)
        clock = StepClock(ledger[0].at.clock)
        if service == "realizer":
            assert isinstance(config, RealizerConfig)
            found.append(_realizer(recording, ledger, clock, lack, config, find))
            continue
        row = SERVICES[service]
        life = Again(row.make(recording.robot, config, clock, session), clock, row.content, lack)
        said = [sent for taken in ledger for sent in _events(life.take(taken, find), taken.at.seconds)]
        live = _said(recording, session, keys.ANY_CONNECTION_EVENT) if service == "recognition" else ()
        compared = Compared(
            service=service, session=session, steps=life.steps, lack=life.lack, differences=tuple(life.differences)
        )
        found.append(_with_words(compared, live, said, near=0.0))
    return found


def _realizer(
    recording: Recording,
    ledger: Sequence[Taken],
    clock: StepClock,
    lack: Lack,
    config: RealizerConfig,
    find: Callable[[str, int], Received | None],
) -> Compared:
    """One life of the realizer, live and again. If its first steps are missing, it is not played."""
    first, steps = ledger[0], [step for taken in ledger for step in taken.steps]
    lack = replace(
        lack, before=first.first - 1, gaps=ledger[-1].first + len(ledger[-1].steps) - first.first - len(steps)
    )
    if lack.before:
        return Compared(service=first.service, session=first.session, steps=0, lack=lack)
    runs = (recording.life(place) for place in range(len(recording)))
    run = next((run for run in runs if session_of(run) == first.session), "")
    said, missing = played(recording.robot, run, steps, clock, find, config)
    compared = Compared(
        service=first.service, session=first.session, steps=len(steps), lack=replace(lack, messages=missing)
    )
    # What came last may be missing live: the recording may have ended before.
    return _with_words(compared, _said(recording, first.session), said, near=NEAR, until=steps[-1].now)


def _said(recording: Recording, session: str, pattern: str = keys.EVERYTHING) -> Iterator[SentMessage]:
    """Messages that a life published, as the recording has them."""
    for place in range(len(recording)):
        if session_of(recording.life(place)) != session or not keys.matches(pattern, recording.key(place)):
            continue
        if (received := recording.received(place)) is not None:
            yield SentMessage(received.key, received.message, received.at)


def _events(outputs: Iterable[Struct], at: Seconds) -> Iterator[SentMessage]:
    """Connection events among what a service gives back."""
    for output in outputs:
        if isinstance(output, PublishMessage) and isinstance(output.message, ConnectionEvent):
            yield SentMessage(output.key, output.message, at)


# -- configurations ---------------------------------------------------------------------------------------------


def _configurations(recording: Recording) -> dict[tuple[str, str], Struct]:
    """Configuration of each life of each service, by the service and the session. Raises InputRefused."""
    found = {}
    for life in settings_of(recording):
        name = life.told.participant
        if name not in CONFIGS or life.unread:
            continue
        config = CONFIGS[name]
        try:
            found[name, session_of(life.told.run)] = msgspec.convert(life.sections.get(name, {}), config)
        except msgspec.ValidationError as error:
            had, _ = explained(error, config)
            reason = f"{name} of Engage {life.told.version} had other settings: {had}"
            fault = Fault(reason=reason, where=recording.name, advice=f"use Engage {life.told.version}")
            raise InputRefused(fault) from error
    return found


def _config(service: str, had: Struct | None, settings: Sequence[str]) -> Struct:
    """The configuration that a service had, else that by default; with those of the settings that are its own.

    Raises InputRefused.
    """
    config = had or CONFIGS[service]()
    own = [line for line in settings if line.startswith(f"{service}.")]
    if not own:
        return config
    before = [f"{key}={value}" for key, value in flat(msgspec.to_builtins(config), f"{service}.") if value]
    changed: Struct = getattr(read(RobotConfig, settings=own, defaults=before), service)
    return changed


# -- comparison -------------------------------------------------------------------------------------------------


def _with_words(
    life: Compared, live: Iterable[SentMessage], again: Iterable[SentMessage], near: Seconds, until: Seconds = inf
) -> Compared:
    """Add the messages, those that differ, in order, and the greatest difference of times of the others.

    near: difference of times that counts as none. until: instant from which on nothing counts.
    """
    live, again = tuple(live), tuple(again)
    before, now = _named(live), _named(again)
    differ, furthest = [], 0.0
    for name in before | now:
        one, other = before.get(name), now.get(name)
        off = inf if one is None or other is None else distance(_plain(one.message), _plain(other.message))
        if off <= near:
            furthest = max(furthest, off)
        elif min(each.at for each in (one, other) if each is not None) < until:
            differ.append(OtherWords(one, other))
    return replace(life, live=live, again=again, other_words=tuple(differ), furthest=furthest)


def _named(said: Iterable[SentMessage]) -> dict[tuple[object, ...], SentMessage]:
    """Messages by what they are about, and how often that was told before.

    Left out is what comes with the clock: renewals, predictions, and another pace for a behavior that may go on as
    far as before. Connection events are known by what they are: if the first steps are missing, or settings are
    others, they are numbered otherwise again.
    """
    told, named = Counter[tuple[object, ...]](), dict[tuple[object, ...], SentMessage]()
    for each in said:
        message = each.message
        if isinstance(message, KeepAlive | PredictionFeedback | Taken) or keys.key_class(each.key) not in (
            "evt",
            "cmd",
        ):
            continue
        if isinstance(message, ConnectionEvent):
            about = ["kind", "initiator", "responder", "started"]
        else:
            about = ["id", "block", "behavior", "sync", "event", "through", "held"]
        name = (each.key, type(message).__name__, *(str(getattr(message, field, None)) for field in about))
        if not (isinstance(message, PerformBehavior) and told[name]):
            named[*name, told[name]] = each
        told[name] += 1
    return named


def _plain(message: Message) -> Any:
    """The message as plain values, without what is no deed: expectations, and numbers of updates and events."""
    match message:
        case SyncPointProgress():
            message = replace(message, predicted=None)
        case PerformBehavior():
            message = replace(message, pace=(), revision=0)
        case ConnectionEvent():
            message = replace(message, id="")
    return msgspec.to_builtins(message)


def distance(one: Any, other: Any) -> float:
    """Greatest difference of two numbers at the same place; inf: they differ in anything else."""
    match one, other:
        case ((bool() | str() | None), _):
            return 0.0 if one == other else inf
        case ((int() | float()), (int() | float())):
            return abs(one - other)
        case dict(), dict() if one.keys() == other.keys():
            return max((distance(one[key], other[key]) for key in one), default=0.0)
        case ((list() | tuple()), (list() | tuple())) if len(one) == len(other):
            return max(map(distance, one, other), default=0.0)
    return inf


# -- in words ---------------------------------------------------------------------------------------------------


def play_again(paths: Sequence[Path], settings: Sequence[str], console: Console) -> int:
    """Play recordings to the services that they are of, and print what comes of it. Returns the exit code."""
    code = DONE
    for path in paths:
        lives = again(opened(path), settings)
        if not lives:
            reason = f"{', '.join(CONFIGS)} told nothing of what they took: none was there, or of another Engage"
            raise InputRefused(Fault(reason=reason, where=str(path)))
        for life in lives:
            for line in told(life, path.name, has_other_settings=bool(settings)):
                console.print(line, markup=False, highlight=False, soft_wrap=True)
            if not settings and life.lack.is_nothing and not life.is_same:
                code = DIFFERENT
    return code


def told(life: Compared, name: str, *, has_other_settings: bool) -> list[str]:
    """Lines about one life of a service, live and again."""
    lack = life.lack
    if life.other_words:
        came = f"{'with other settings' if has_other_settings else 'again'} {len(life.other_words)} messages differ"
    elif lack.before and not life.steps:
        came = "it is played from its beginning on alone"
    elif life.differences and not life.live:
        came = f"{len(life.differences)} led to something else"
    else:
        came = f"again the same, {_how_near(life)}"
    lines = [f"{name}, {life.service}, life {life.session}: {life.steps} steps; {came}"]
    if lack.settings:
        lines.append(f"  the settings of {life.service} are missing or cannot be read: again it has those by default")
    if lack.before:
        lines.append(f"  {lack.before} steps are from before the recording: what had begun by then is not known")
    if lack.gaps or lack.messages:
        lines.append(f"  {lack.gaps} steps and {lack.messages} messages that it took are missing in the recording")
    if life.service == "recognition" and life.other_words:
        lines += [f"  live:  {_counts(life.live)}", f"  again: {_counts(life.again)}"]
    if not has_other_settings and life.differences:  # all that follows may come of the first
        one = life.differences[0]
        did = ", ".join(map(str, one.outputs)) or "nothing"
        lines.append(
            f"  first step {one.number}, at {one.step.now:.3f} s, which took {_input(one.step)}: again {did}"
        )
    for words in life.other_words[:SHOWN]:
        said = words.live or words.again
        assert said is not None
        lines.append(f"  at {said.at:.3f} s, {type(said.message).__name__} on {said.key}")
        lines.append(f"    live:  {words.live.message if words.live else 'nothing'}")
        lines.append(f"    again: {words.again.message if words.again else 'nothing'}")
    return lines


def _how_near(life: Compared) -> str:
    if life.differences:
        return "but for the numbers of the events"
    return f"at times within {1000 * life.furthest:.1f} ms" if life.furthest else "to the last bit"


def _input(step: Step) -> str:
    if step.content is not None:
        return f"{step.content} {step.key}".strip()
    return f"message {step.number} of {step.life}" if step.number else "what was due"


def _counts(said: Sequence[SentMessage]) -> str:
    states = Counter(getattr(each.message, "state", "") for each in said)
    return ", ".join(f"{count} {state}" for state, count in sorted(states.items())) or "none"
