"""The service of hearing: feeds ears with sound and a recognizer with speech, and tells the bus who says what.

A voice is told as the action `speak` of a person, with the instants at which it was to be heard, which lie some time
back when they are known. Where a recognizer is at work, an utterance without words comes first: words will follow.
"""

import asyncio
import time
from collections.abc import AsyncGenerator, Iterable
from contextlib import aclosing
from itertools import count

import numpy as np
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.participants import PeerAlive
from engage_hri.schemas.perception import (
    LONGEST_TEXT,
    ActionBegan,
    ActionEnded,
    ActorFound,
    ActorLost,
    Utterance,
)
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus import journal
from engage_hri.services.bus.interface import Bus, Received, Subscription
from engage_hri.services.client.people.perceived_person import PerceivedActions, free_seat
from engage_hri.services.client.people.shared_world import SharedWorld
from engage_hri.services.perception.hearing.config import HearingConfig
from engage_hri.services.perception.hearing.listening import InItsOwn, InThisProcess, Order, Understanding
from engage_hri.services.perception.hearing.microphone import SoundLost, is_file, pieces
from engage_hri.services.perception.hearing.recognizing import Answer, KnownWords, SpeechWords, settings_of
from engage_hri.services.perception.hearing.sound import Piece
from engage_hri.services.perception.hearing.voice import (
    VoiceBegan,
    VoiceEar,
    VoiceEnded,
    VoiceEvent,
    VoiceSound,
    silero,
)
from engage_hri.services.runtime.installation import extra_command
from engage_hri.services.runtime.service import Ready
from engage_hri.services.runtime.settings import tell_settings

VISITOR = "visitor"
"""Id of the person who speaks where nobody tells of any."""
LOOK_AROUND: Seconds = 0.5
"""Time in which the world, if anybody tells it, is known."""
AGAIN: Seconds = 2.0
"""Time after which a device is tried again that gave no sound."""
ECHO: Seconds = 0.2
"""Time for which the robot's voice goes on in the room, and in the devices, when it has ended."""
LAST_WORDS: Seconds = 25.0
"""Time that the words of a file may take when it is over."""


async def hear(bus: Bus, ready: Ready, config: HearingConfig) -> None:
    """Serve until cancelled, or until the file is over and all that was said in it is told.

    A file begins when recognition is there, for before that its first words would be lost.

    Raises InputRefused: there is no such sound or recognizer, or a package is not installed.
    """
    with bus.subscribe(keys.ANY_ROBOT_ALIVE, keys.WORLD, keys.ROBOT_ACTION) as inbox:
        tell_settings(bus, "hearing", config)
        hearing = _Hearing(bus, config)
        try:
            if hearing.recognizer is not None:
                await hearing.recognizer.made()
            ready()
            await hearing.wait_for_recognition(inbox)
            await hearing.listen(inbox)
        finally:
            hearing.close()


class _Speech:
    """A speech that goes on, or whose words are awaited. number: for the recognizer."""

    def __init__(self, number: int, utterance: Utterance) -> None:
        self.number, self.utterance = number, utterance


class _Hearing:
    """The ears of the service, and what was heard. recognizer: None: nobody understands words."""

    def __init__(self, bus: Bus, config: HearingConfig) -> None:
        self._bus, self._config = bus, config
        self._channels = max(1, len(config.people))
        try:
            self._ears = [VoiceEar(silero(), config.pause) for _ in range(self._channels)]
        except ModuleNotFoundError as error:
            raise InputRefused(Fault(reason=str(error), where="hearing", advice=extra_command("hearing"))) from error
        self._world, self._perceived = SharedWorld(bus.name), PerceivedActions(bus)
        self._own: dict[str, Entity] = {}
        """The people whom this service has brought into the world, since nobody else tells of them."""
        self._voices: list[_Speech | None] = [None] * self._channels
        """What is being said, by channel; None also of a voice that is nobody's."""
        self._awaited: dict[int, _Speech] = {}
        """Speeches whose words are not known for good, by number."""
        self._all_known = asyncio.Event()
        self._numbers = count(1)
        self._robot_speaks_until: Seconds | None = None
        is_deaf = config.is_deaf_while_robot_speaks
        self._is_deaf = not is_file(config.source) if is_deaf is None else is_deaf
        self._told: set[str] = set()
        """Reasons of faults that were told and have not passed."""
        self.recognizer = self._understanding()

    def _understanding(self) -> Understanding | None:
        if not self._config.recognizer:
            return None
        is_real = abs(self._bus.now() - time.monotonic()) < 1.0
        kind = InItsOwn if is_real else InThisProcess
        return kind(Order(self._config.recognizer, settings_of(self._config)), self._answered)

    async def wait_for_recognition(self, inbox: Subscription) -> None:
        """Wait until recognition is there, and for the world. Then people come who have channels of their own."""
        deadline = None
        while (received := await inbox.next(deadline)) is not None:
            self._take(received)
            match received.message:
                case PeerAlive(participant="recognition"):
                    deadline = self._bus.now() + LOOK_AROUND
        for person in self._config.people:
            self._bring(person, self._bus.now())

    async def listen(self, inbox: Subscription) -> None:
        """Hear all that the source gives; what a device does not give is told, and it is tried again."""
        while True:
            try:
                async with aclosing(pieces(self._config.source, self._channels)) as sound:
                    await self._hear(inbox, sound)
                return
            except SoundLost as lost:
                self._lose(lost.fault)
            until = self._bus.now() + AGAIN
            while (received := await inbox.next(until)) is not None:
                self._take(received)

    async def _hear(self, inbox: Subscription, sound: AsyncGenerator[Piece, None]) -> None:
        async for piece in sound:
            if self._told:
                self._told.clear()
                journal.alert(self._bus.log, "hearing again")
            while len(inbox):
                received = await inbox.next()
                if received is not None:
                    self._take(received)
            for channel, ear in enumerate(self._ears):
                samples = np.ascontiguousarray(piece.samples[:, channel])
                if self._is_deaf and self._robot_speaks(piece.at):
                    samples = np.zeros_like(samples)
                self._tell(channel, ear.feed(samples, piece.at))
        for channel, ear in enumerate(self._ears):
            self._tell(channel, ear.lose())
        if self._awaited:
            self._all_known.clear()
            try:
                async with asyncio.timeout(LAST_WORDS):
                    await self._all_known.wait()
            except TimeoutError:
                pass

    def close(self) -> None:
        """End what goes on, let the people leave who were brought, and end the recognizer."""
        for channel, ear in enumerate(self._ears):
            self._tell(channel, ear.lose())
        if self.recognizer is not None:
            self.recognizer.close()
        if self._own:
            people = tuple(self._own)
            self._own.clear()
            self._show(self._bus.now())
            self._perceived.tell(*(ActorLost(actor=person, at=self._bus.stamp()) for person in people))

    # -- voices -------------------------------------------------------------------------------------------------

    def _tell(self, channel: int, events: Iterable[VoiceEvent]) -> None:
        for event in events:
            match event:
                case VoiceBegan(at=at):
                    self._voices[channel] = self._began(channel, at)
                case VoiceSound(samples=samples) if (speech := self._voices[channel]) is not None:
                    if self.recognizer is not None:
                        self.recognizer.hear(speech.number, samples.astype("<i2").tobytes())
                case VoiceEnded(at=at) if (speech := self._voices[channel]) is not None:
                    self._voices[channel] = None
                    self._ended(speech, at)

    def _began(self, channel: int, at: Seconds) -> _Speech | None:
        if (person := self._speaker(channel)) is None:
            return None
        self._bring(person, at)
        number, stamp = next(self._numbers), self._bus.stamp(at)
        words = Utterance(actor=person, id=f"{self._bus.run}-{number}", text="", began=stamp, at=stamp, final=False)
        speech = _Speech(number, words)
        if self.recognizer is not None:
            self._awaited[number] = speech
            self._bus.publish(keys.UTTERANCE, words)  # first, so that whoever waits knows that words will come
        self._perceived.tell(ActionBegan(actor=person, action="speak", at=stamp))
        return speech

    def _ended(self, speech: _Speech, at: Seconds) -> None:
        stamp = self._bus.stamp(at)
        speech.utterance = replace(speech.utterance, ended=stamp)
        self._perceived.tell(ActionEnded(actor=speech.utterance.actor, action="speak", at=stamp))
        if self.recognizer is not None:
            self.recognizer.hear(speech.number, b"")

    def _speaker(self, channel: int) -> str | None:
        """The person whose voice this is. None: there are several, and one channel cannot tell them apart."""
        if self._config.people:
            return self._config.people[channel]
        here = [each.id for each in self._world.entities if each.kind == "person"]
        if len(here) > 1:
            reason = f"whose voice it is cannot be told: {', '.join(here)} are here, and there is one channel"
            self._complain(Fault(reason=reason, where="hearing.people", advice="name one person for each channel"))
            return None
        return here[0] if here else VISITOR

    def _robot_speaks(self, at: Seconds) -> bool:
        return self._robot_speaks_until is not None and at < self._robot_speaks_until

    def _lose(self, fault: Fault) -> None:
        for channel, ear in enumerate(self._ears):
            self._tell(channel, ear.lose())
        self._complain(fault)

    def _complain(self, fault: Fault) -> None:
        if fault.reason not in self._told:
            self._told.add(fault.reason)
            self._publish(fault)

    def _publish(self, fault: Fault) -> None:
        """Tell a fault that is no bug of ours."""
        journal.alert(self._bus.log, "%s", fault)
        self._bus.publish(keys.fault(self._bus.name), replace(fault, service=self._bus.name))

    # -- words --------------------------------------------------------------------------------------------------

    def _answered(self, answer: Answer) -> None:
        speech = self._awaited.get(answer.speech)
        if speech is None:
            return
        words, is_final = SpeechWords(""), True
        if isinstance(answer, KnownWords):
            words, is_final = answer.words, answer.final
        else:
            self._publish(answer.fault)
        now = self._bus.stamp()
        said = replace(
            speech.utterance, text=words.text[:LONGEST_TEXT], at=now, final=is_final, confidence=words.confidence
        )
        self._bus.publish(keys.UTTERANCE, replace(said, ended=said.ended or now) if is_final else said)
        if is_final:
            del self._awaited[answer.speech]
            if not self._awaited:
                self._all_known.set()

    # -- who is here --------------------------------------------------------------------------------------------

    def _take(self, received: Received) -> None:
        """Take what others tell of the world, of who is there, and of the robot's own voice."""
        message, now = received.message, self._bus.now()
        with self._bus.containing(received):
            if self._world.take(message, received.source, now) and self._own:
                self._show(now)
            match message:
                case ActionBegan(actor=self._bus.robot, action="speak"):
                    self._robot_speaks_until = float("inf")
                case ActionEnded(actor=self._bus.robot, action="speak", at=at):
                    self._robot_speaks_until = self._bus.local(at) + ECHO

    def _bring(self, person: str, at: Seconds) -> None:
        """Bring a person into the world, unless somebody tells of them there."""
        if any(each.id == person for each in self._world.entities):
            return
        seats = [each.position for each in self._world.entities if each.kind == "person"]
        self._own[person] = Entity(id=person, kind="person", position=free_seat(seats))
        self._show(self._bus.now())
        self._perceived.tell(ActorFound(actor=person, at=self._bus.stamp(at)))

    def _show(self, now: Seconds) -> None:
        self._bus.publish(keys.WORLD, World(entities=self._world.tell(self._own.values(), now), at=self._bus.stamp()))
