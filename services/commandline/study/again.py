"""Services once more, over a recording: each takes what its ledger says that it took, and is to do the same.

Which service is played how is in one table, `SERVICES`: a new one is a row.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
from msgspec import Struct, structs
from rich.console import Console

from engage_hri.schemas import keys
from engage_hri.schemas.advice import explained
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.participants import Step, Taken
from engage_hri.schemas.recognition import ConnectionEvent, session_of
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.samples import Received
from engage_hri.services.commandline.shell.process import DONE
from engage_hri.services.commandline.shell.recording_file import opened
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.commandline.study.realizer_again import OtherWords, SentMessage, compared, played
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.serving.intake import ControlIntake
from engage_hri.services.control.serving.steps import ControlStep
from engage_hri.services.generation import intake as generation
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.recognition import intake as recognition
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recording.reading import Recording
from engage_hri.services.recording.settings import flat, settings_of
from engage_hri.services.runtime.again import Again, Find, Lack, StepDifference
from engage_hri.services.runtime.configuration import read
from engage_hri.services.runtime.intake import PublishMessage, ServiceIntake
from engage_hri.services.runtime.ledger import StepClock

DIFFERENT = 1
"""Exit code if a service does something else with the same settings, and nothing is missing."""
SHOWN = 10
"""Differences that are printed."""


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
"""Services that can be played to, and the type of the configuration of each. The realizer has no intake."""


class Compared(Struct, frozen=True, kw_only=True):
    """One life of a service, live and again. differences: steps that led to something else again, in order.

    live, again: changes of connection events that it published; only recognition has some. other_words: messages that
    say something else again, and furthest: greatest difference of times of all others; only of the realizer.
    """

    service: str
    session: str
    steps: int
    differences: tuple[StepDifference, ...]
    lack: Lack
    live: tuple[ConnectionEvent, ...] = ()
    again: tuple[ConnectionEvent, ...] = ()
    other_words: tuple[OtherWords, ...] = ()
    furthest: Seconds = 0.0

    @property
    def is_same(self) -> bool:
        return not self.differences and not self.other_words

    def changed_events(self) -> list[tuple[ConnectionEvent | None, ConnectionEvent | None]]:
        """Changes of events that only one side has, or that differ: of one event and state together.

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


def again(
    recording: Recording, settings: Sequence[str] = (), services: Iterable[str] = tuple(CONFIGS)
) -> list[Compared]:
    """Play it to each life of these services once more; with settings, `SERVICE.KEY=VALUE`, to those alone.

    The realizer runs on an event loop, so nobody may ask for it on another one.
    Raises InputRefused: there is no such setting, or this Engage does not know those that the service had.
    """
    lives: dict[tuple[str, str], Again] = {}
    live: dict[str, list[ConnectionEvent]] = {}
    numbers, configs = _numbers(recording), _configurations(recording)
    meant = {line.partition(".")[0] for line in settings} or {*services}
    ledgers: dict[str, list[Taken]] = {}

    def find(life: str, number: int) -> Received | None:
        place = numbers.get((life, number & 0xFFFFFFFF))
        return None if place is None else recording.received(place)

    for place in range(len(recording)):
        key = recording.key(place)
        if not keys.matches(keys.ANY_TAKEN, key) and not keys.matches(keys.ANY_CONNECTION_EVENT, key):
            continue
        message = getattr(recording.received(place), "message", None)
        if isinstance(message, ConnectionEvent):
            live.setdefault(message.session, []).append(message)
        elif isinstance(message, Taken) and message.service in meant and message.service in SERVICES:
            name = (message.service, message.session)
            if name not in lives:
                lives[name] = _begun(recording.robot, message, configs.get(name), settings)
            lives[name].take(message, find)
        elif isinstance(message, Taken) and message.service == "realizer" and message.service in meant:
            ledgers.setdefault(message.session, []).append(message)
    realizers = [_realizer(recording, ledger, configs, settings, find) for ledger in ledgers.values()]
    return realizers + [
        Compared(
            service=service, session=session, steps=life.steps, differences=tuple(life.differences), lack=life.lack,
            live=tuple(live.get(session, ())) if service == "recognition" else (), again=tuple(_events(life.outputs)),
        )
        for (service, session), life in lives.items()
    ]  # fmt: skip


def _realizer(
    recording: Recording,
    ledger: Sequence[Taken],
    configs: Mapping[tuple[str, str], Struct],
    settings: Sequence[str],
    find: Find,
) -> Compared:
    """One life of the realizer, live and again. If its first steps are missing, it is not played."""
    first, steps = ledger[0], [step for taken in ledger for step in taken.steps]
    before, gaps = first.first - 1, ledger[-1].first + len(ledger[-1].steps) - first.first - len(steps)
    had = configs.get(("realizer", first.session))
    lack = Lack(settings=had is None, before=before, gaps=gaps)
    if before:
        return Compared(service="realizer", session=first.session, steps=0, differences=(), lack=lack)
    config = _config("realizer", had, settings)
    assert isinstance(config, RealizerConfig)
    live = [*_said(recording, first.session)]
    run = next(
        (life for place in range(len(recording)) if (life := recording.life(place)).startswith(first.session)), ""
    )
    said, missing = played(recording.robot, run, steps, StepClock(first.at.clock), find, config)
    differ, furthest = compared(live, said, steps[-1].now)
    return Compared(
        service="realizer", session=first.session, steps=len(steps), differences=(),
        lack=structs.replace(lack, messages=missing), other_words=tuple(differ), furthest=furthest,
    )  # fmt: skip


def _said(recording: Recording, session: str) -> Iterable[SentMessage]:
    """Messages that a life published, as the recording has them."""
    for place in range(len(recording)):
        if session_of(recording.life(place)) == session:
            received = recording.received(place)
            if received is not None:
                yield SentMessage(received.key, received.message, received.at)


def _begun(robot: str, first: Taken, had: Struct | None, settings: Sequence[str]) -> Again:
    """The life of a service that begins with these steps."""
    service = SERVICES[first.service]
    config = _config(first.service, had, settings)
    clock = StepClock(first.at.clock)
    return Again(
        service.make(robot, config, clock, first.session), clock, service.content, Lack(settings=had is None)
    )


def _config(service: str, had: Struct | None, settings: Sequence[str]) -> Struct:
    """The configuration that a service had, else that by default; with those of the settings that are its own."""
    config = had or CONFIGS[service]()
    own = [line for line in settings if line.startswith(f"{service}.")]
    return with_settings(service, config, own) if own else config


def _events(outputs: Iterable[Struct]) -> Iterable[ConnectionEvent]:
    for output in outputs:
        if isinstance(output, PublishMessage) and isinstance(output.message, ConnectionEvent):
            yield output.message


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


def with_settings(service: str, config: Struct, settings: Sequence[str]) -> Struct:
    """The same with other settings, `SERVICE.KEY=VALUE`. Raises InputRefused."""
    had = [f"{key}={value}" for key, value in flat(msgspec.to_builtins(config), f"{service}.") if value]
    changed: Struct = getattr(read(RobotConfig, settings=settings, defaults=had), service)
    return changed


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
    events = f", {len({one.id for one in life.live})} events, {len(life.live)} changes" if life.live else ""
    head = f"{name}, {life.service}, life {life.session}: {life.steps} steps{events}"
    lines, lack = [], life.lack
    if lack.settings:
        lines.append(f"  the settings of {life.service} are missing or cannot be read: again it has those by default")
    if lack.before:
        lines.append(f"  {lack.before} steps are from before the recording: what had begun by then is not known")
    if lack.gaps or lack.messages:
        lines.append(f"  {lack.gaps} steps and {lack.messages} messages that it took are missing in the recording")
    if life.service == "realizer":
        return [head + _realizer_words(life), *lines, *_word_lines(life.other_words)]
    if life.is_same and not has_other_settings:
        return [f"{head}: again the same, to the last bit", *lines]
    if life.live or life.again:
        events_lines, number = _event_lines(life)
        if not number and lack.before:
            return [f"{head}: again the same, but for the numbers of the events", *lines]
        why = "with other settings" if has_other_settings else "again"
        return [f"{head}; {why} {number} differ", *lines, *events_lines]
    return [f"{head}; {len(life.differences)} led to something else", *lines, *_step_lines(life.differences)]


def _event_lines(life: Compared) -> tuple[list[str], int]:
    """Lines about the events that differ, and their number."""
    different = life.changed_events()
    lines = [f"  live:  {_counts(life.live)}", f"  again: {_counts(life.again)}"]
    for was, now in different[:SHOWN]:
        one = was or now
        assert one is not None
        lines.append(f"  {one.id} {one.kind} {one.state}: {_delay(was)}, again {_delay(now)}")
    if len(different) > SHOWN:
        lines.append(f"  and {len(different) - SHOWN} more")
    return lines, len(different)


def _realizer_words(life: Compared) -> str:
    if life.lack.before:
        return ": it is played from its beginning on alone"
    if life.other_words:
        return f"; {len(life.other_words)} messages differ"
    return ": again the same" + (
        f", at times within {1000 * life.furthest:.1f} ms" if life.furthest else ", to the last bit"
    )


def _word_lines(differences: Sequence[OtherWords]) -> Iterable[str]:
    """Lines about the first messages of the realizer that differ."""
    for one in differences[:SHOWN]:
        said = one.live or one.again
        assert said is not None
        yield f"  at {said.at:.3f} s, {type(said.message).__name__} on {said.key}"
        yield f"    live:  {one.live.message if one.live else 'nothing'}"
        yield f"    again: {one.again.message if one.again else 'nothing'}"


def _step_lines(differences: Sequence[StepDifference]) -> Iterable[str]:
    """Line about the first step that led to something else: all that follows may come of it."""
    for one in differences[:1]:
        did = ", ".join(str(output) for output in one.outputs) or "nothing"
        yield f"  first step {one.number}, at {one.step.now:.3f} s, which took {_input(one.step)}: again {did}"


def _input(step: Step) -> str:
    if step.content is not None:
        return f"{step.content} {step.key}".strip()
    return f"message {step.number} of {step.life}" if step.number else "what was due"


def _counts(events: Sequence[ConnectionEvent]) -> str:
    states = Counter(one.state for one in events)
    return ", ".join(f"{count} {state}" for state, count in sorted(states.items())) or "none"


def _delay(event: ConnectionEvent | None) -> str:
    if event is None:
        return "not there"
    return "there" if event.delay is None else f"{event.delay:.6f} s"
