"""The service of hearing: feeds ears with sound and a recognizer with speech, and tells the bus who says what.

A voice is told as the action `speak` of a person, with the instants at which it was to be heard, which lie some time
back when they are known. Where a recognizer is at work, an utterance without words comes first: words will follow.
"""

import asyncio
import time
from collections import deque
from collections.abc import AsyncGenerator, Callable, Iterable
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
from engage_hri.schemas.sound import SoundFrame
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus import journal
from engage_hri.services.bus.interface import Bus, Received, Subscription
from engage_hri.services.client.people.perceived_person import PerceivedActions, free_seat
from engage_hri.services.client.people.shared_world import SharedWorld
from engage_hri.services.perception.hearing.config import PAGE, HearingConfig
from engage_hri.services.perception.hearing.listening import InItsOwn, InThisProcess, Order, Understanding
from engage_hri.services.perception.hearing.microphone import SILENT, SoundLost, is_file, opened
from engage_hri.services.perception.hearing.own_voice import VAIN, Canceller, CautiousJudge, OwnVoice
from engage_hri.services.perception.hearing.recognizing import Answer, KnownWords, SpeechWords, settings_of
from engage_hri.services.perception.hearing.sound import Piece
from engage_hri.services.perception.hearing.voice import (
    RATE,
    Samples,
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
BEFORE_SPEECH: Seconds = 1.0
"""Time before the robot speaks from which on sound of its voice is that of this speech."""
ECHO: Seconds = 0.2
"""Time for which the robot's voice goes on in the room, and in the devices, when it has ended."""
LAST_WORDS: Seconds = 25.0
"""Time that the words of a file may take when it is over."""
MOST_PAGES = 16
"""Microphones of pages that are heard at once: a detector needs 10 MB, and 0.7 % of a processor."""
OLD: Seconds = 10.0
"""Age from which on sound of a page is of no use."""
WHOLE: Seconds = 5.0
"""Time without loss after which a loss is told again."""


async def hear(bus: Bus, ready: Ready, config: HearingConfig) -> None:
    """Serve until cancelled, or until the file is over and all that was said in it is told.

    What is said before recognition is there would be lost: a file begins then, and pages are heard from then on.

    Raises InputRefused: there is no such sound or recognizer, or a package is not installed.
    """
    pages = (keys.ANY_SOUND,) if config.source == PAGE else ()
    own = (keys.ROBOT_SOUND,) if is_cancelling(config) else ()
    with bus.subscribe(keys.ANY_ROBOT_ALIVE, keys.WORLD, keys.ROBOT_ACTION, *pages, *own) as inbox:
        tell_settings(bus, "hearing", config)
        hearing = _Hearing(bus, config)
        try:
            if hearing.recognizer is not None:
                await hearing.recognizer.made()
            ready()
            await hearing.wait_for_recognition(inbox)
            await (hearing.hear_pages(inbox) if pages else hearing.listen(inbox))
        finally:
            hearing.close()


def is_cancelling(config: HearingConfig) -> bool:
    """Tell whether the robot's own voice is taken out of the sound: where it is recorded now, unless it is set."""
    return config.is_deaf_while_robot_speaks is None and not is_file(config.source)


class _Speech:
    """A speech that goes on, or whose words are awaited. number: for the recognizer."""

    def __init__(self, number: int, utterance: Utterance) -> None:
        self.number, self.utterance = number, utterance


class _Channel:
    """A channel of sound. person: whose voice is in it; empty: that of the only person who is here.

    voice: what is being said; None also of a voice that is nobody's. canceller, judge: None: the robot's own voice
    stays in it.
    """

    def __init__(self, person: str, pause: Seconds, own: OwnVoice | None) -> None:
        self.person = person
        self.canceller = None if own is None else Canceller(own)
        self.judge = None if self.canceller is None else CautiousJudge(silero(), self.canceller)
        self.ear = VoiceEar(self.judge or silero(), pause)
        self.voice: _Speech | None = None


class _PageChannel(_Channel):
    """The microphone of a page. number: of the last frame. came: loop time of its arrival. lossy: that of a loss."""

    def __init__(self, person: str, pause: Seconds, own: OwnVoice | None, number: int) -> None:
        super().__init__(person, pause, own)
        self.number, self.came, self.lossy = number, 0.0, float("-inf")


class _Hearing:
    """The ears of the service, and what was heard. recognizer: None: nobody understands words."""

    def __init__(self, bus: Bus, config: HearingConfig) -> None:
        """Raises InputRefused: there is no such source or recognizer, or a package is not installed."""
        self._bus, self._config = bus, config
        people = config.people or ("",)
        self._own_voice = OwnVoice() if is_cancelling(config) else None
        self._pages: dict[str, _PageChannel] = {}
        """Channels of pages, by person."""
        self._channels: list[_Channel] = []
        """Those of a file or a device."""
        try:
            silero()
        except ModuleNotFoundError as error:
            raise InputRefused(Fault(reason=str(error), where="hearing", advice=extra_command("hearing"))) from error
        if config.source != PAGE:
            self._sound: Callable[[], AsyncGenerator[Piece, None]] = opened(config.source, len(people))
            self._channels = [_Channel(person, config.pause, self._own_voice) for person in people]
        self._world, self._perceived = SharedWorld(bus.name), PerceivedActions(bus)
        self._own: dict[str, Entity] = {}
        """The people whom this service has brought into the world, since nobody else tells of them."""
        self._awaited: dict[int, _Speech] = {}
        """Speeches whose words are not known for good, by number."""
        self._all_known = asyncio.Event()
        self._numbers = count(1)
        self._robot_speaks = float("-inf"), float("-inf")
        """Since when the robot speaks, or has spoken last, and until when."""
        self._told: deque[str] = deque(maxlen=16)
        """Reasons of the faults that were told last, each once."""
        self._is_lost = False
        """No sound comes from the device, which was told."""
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
                async with aclosing(self._sound()) as sound:
                    await self._hear(inbox, sound)
                return
            except SoundLost as lost:
                self._lose(lost.fault)
            until = self._bus.now() + AGAIN
            while (received := await inbox.next(until)) is not None:
                self._take(received)

    async def _hear(self, inbox: Subscription, sound: AsyncGenerator[Piece, None]) -> None:
        async for piece in sound:
            if self._is_lost:
                self._is_lost = False
                journal.alert(self._bus.log, "hearing again")
            while len(inbox):
                received = await inbox.next()
                if received is not None:
                    self._take(received)
            for number, channel in enumerate(self._channels):
                self._feed(channel, np.ascontiguousarray(piece.samples[:, number]), piece.at)
        for channel in self._channels:
            self._tell(channel, channel.ear.lose())
        if self._awaited:
            self._all_known.clear()
            try:
                async with asyncio.timeout(LAST_WORDS):
                    await self._all_known.wait()
            except TimeoutError:
                pass

    def close(self) -> None:
        """End what goes on, let the people leave who were brought, and end the recognizer."""
        for channel in (*self._channels, *self._pages.values()):
            self._tell(channel, channel.ear.lose())
        if self.recognizer is not None:
            self.recognizer.close()
        self._let_go(*self._own)

    # -- pages --------------------------------------------------------------------------------------------------

    async def hear_pages(self, inbox: Subscription) -> None:
        """Hear all microphones of pages that are on, for ever. One that gives nothing any more is told, and ends."""
        while True:
            until = min((page.came for page in self._pages.values()), default=float("inf")) + SILENT
            received = await inbox.next(until)
            if received is None:
                for page in [page for page in self._pages.values() if self._bus.now() >= page.came + SILENT]:
                    self._end(page)
                    reason = f"no sound comes any more from the microphone of {page.person}"
                    advice = "is the page, or the computer it is on, asleep or cut off?"
                    self._publish(Fault(reason=reason, where=keys.sound(page.person), advice=advice))
            elif isinstance(received.message, SoundFrame) and received.key != keys.ROBOT_SOUND:
                with self._bus.containing(received):
                    self._hear_page(received.key.rpartition("/")[2], received.message)
            else:
                self._take(received)

    def _hear_page(self, person: str, frame: SoundFrame) -> None:
        now, page = self._bus.now(), self._pages.get(person)
        if not frame.samples:
            if page is not None:
                self._end(page)
                self._bus.log.info("the microphone of %s is off", person)
            return
        if frame.rate != RATE:
            reason = f"the sound of {person} has {frame.rate} samples per second: expected {RATE}"
            self._bus.tell_refused(Fault(reason=reason, where=keys.sound(person)), person)
            return
        at = min(self._bus.local(frame.at), now - len(frame.samples) / 2 / RATE)
        if now - at > OLD or (page is None and (page := self._begin(person, frame.number)) is None):
            return
        if frame.number > page.number + 1:
            if now - page.lossy > WHOLE:
                reason = f"sound from the microphone of {person} is lost on its way"
                self._publish(Fault(reason=reason, where=keys.sound(person), advice="the link of the page is slow"))
            page.lossy = now
        page.number, page.came = frame.number, now
        self._feed(page, np.frombuffer(frame.samples, "<i2"), at)

    def _begin(self, person: str, number: int) -> _PageChannel | None:
        """Begin to hear a page with the frame of this number. None: there are so many that it is not heard."""
        if len(self._pages) >= MOST_PAGES:
            reason = f"{MOST_PAGES} microphones are heard already, and that of {person} is not"
            self._bus.tell_refused(Fault(reason=reason, where=keys.sound(person)), person)
            return None
        self._bus.log.info("the microphone of %s is on", person)
        page = self._pages[person] = _PageChannel(person, self._config.pause, self._own_voice, number)
        return page

    def _end(self, page: _PageChannel) -> None:
        """Hear a page no more: what was being said has ended, and who was brought by it leaves."""
        self._tell(page, page.ear.lose())
        del self._pages[page.person]
        self._let_go(page.person)

    # -- voices -------------------------------------------------------------------------------------------------

    def _feed(self, channel: _Channel, samples: Samples, at: Seconds) -> None:
        """Let a channel have more sound. at: loop time at which its first sample was captured."""
        if self._is_deaf(at):
            samples = np.zeros_like(samples)
        if channel.canceller is not None and channel.judge is not None:
            samples, at = channel.canceller.feed(samples, at)
            if channel.judge.in_vain > VAIN:
                reason = "the robot's own voice cannot be taken out of the sound: nobody is heard while it speaks"
                self._complain(
                    Fault(reason=reason, where="hearing", advice="use a headset, or the page that plays it")
                )
        self._tell(channel, channel.ear.feed(samples, at))

    def _tell(self, channel: _Channel, events: Iterable[VoiceEvent]) -> None:
        for event in events:
            match event:
                case VoiceBegan(at=at):
                    channel.voice = self._began(channel, at)
                case VoiceSound(samples=samples) if channel.voice is not None:
                    if self.recognizer is not None:
                        self.recognizer.hear(channel.voice.number, samples.astype("<i2").tobytes())
                case VoiceEnded(at=at) if (speech := channel.voice) is not None:
                    channel.voice = None
                    self._ended(speech, at)

    def _began(self, channel: _Channel, at: Seconds) -> _Speech | None:
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

    def _speaker(self, channel: _Channel) -> str | None:
        """The person whose voice this is. None: there are several, and one channel cannot tell them apart."""
        if channel.person:
            return channel.person
        here = [each.id for each in self._world.entities if each.kind == "person"]
        if len(here) > 1:
            reason = f"whose voice it is cannot be told: {', '.join(here)} are here, and there is one channel"
            self._complain(Fault(reason=reason, where="hearing.people", advice="name one person for each channel"))
            return None
        return here[0] if here else VISITOR

    def _is_deaf(self, at: Seconds) -> bool:
        """True if the robot's voice may be heard at this time, and cannot be told from a person's."""
        since, until = self._robot_speaks
        if not since <= at < until:
            return False
        if self._own_voice is None:
            return bool(self._config.is_deaf_while_robot_speaks)
        if self._own_voice.told >= since - BEFORE_SPEECH:
            return False
        reason = "nobody is heard while the robot speaks, for the sound of its voice is not told"
        advice = "if it makes none, or with a headset: --set hearing.is_deaf_while_robot_speaks=false"
        self._complain(Fault(reason=reason, where="hearing", advice=advice))
        return True

    def _lose(self, fault: Fault) -> None:
        for channel in self._channels:
            self._tell(channel, channel.ear.lose())
        if not self._is_lost:
            self._is_lost = True
            self._publish(fault)

    def _complain(self, fault: Fault) -> None:
        if fault.reason not in self._told:
            self._told.append(fault.reason)
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
                case ActionBegan(actor=self._bus.robot, action="speak", at=at):
                    self._robot_speaks = self._bus.local(at), float("inf")
                case ActionEnded(actor=self._bus.robot, action="speak", at=at):
                    self._robot_speaks = self._robot_speaks[0], self._bus.local(at) + ECHO
                case SoundFrame() if self._own_voice is not None:
                    samples = np.frombuffer(message.samples, "<i2")
                    self._own_voice.take(samples, message.rate, self._bus.local(message.at))

    def _bring(self, person: str, at: Seconds) -> None:
        """Bring a person into the world, unless somebody tells of them there."""
        if any(each.id == person for each in self._world.entities):
            return
        seats = [each.position for each in self._world.entities if each.kind == "person"]
        self._own[person] = Entity(id=person, kind="person", position=free_seat(seats))
        self._show(self._bus.now())
        self._perceived.tell(ActorFound(actor=person, at=self._bus.stamp(at)))

    def _let_go(self, *people: str) -> None:
        """Let those of these people leave whom this service has brought into the world."""
        gone = [person for person in people if self._own.pop(person, None) is not None]
        if gone:
            self._show(self._bus.now())
            self._perceived.tell(*(ActorLost(actor=person, at=self._bus.stamp()) for person in gone))

    def _show(self, now: Seconds) -> None:
        self._bus.publish(keys.WORLD, World(entities=self._world.tell(self._own.values(), now), at=self._bus.stamp()))
