"""Speeches in sound: when a voice begins and ends in a channel, whose it is, and which words it has.

A voice is told as the action `speak` of a person, with the instants at which it was to be heard, which lie some time
back when they are known. Where a recognizer is at work, an utterance without words comes first: words will follow.

In a channel that is nobody's own, among several people, it is told at once as that of `voice_1`; when lips show whose
it is, that they are the same (`ActorFound.same_as`), and once more if they show otherwise later.
"""

import asyncio
import time
from collections.abc import Iterable
from itertools import count

import numpy as np
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import (
    LONGEST_TEXT,
    ActionBegan,
    ActionEnded,
    ActorFound,
    ActorLost,
    HeadPose,
    SoundFrame,
    Utterance,
)
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.perception.hearing.company import HeardPeople
from engage_hri.services.perception.hearing.config import HearingConfig
from engage_hri.services.perception.hearing.lips import Lips
from engage_hri.services.perception.hearing.listening import (
    DetectorOrder,
    InItsOwn,
    InThisProcess,
    Order,
    Understanding,
)
from engage_hri.services.perception.hearing.microphone import is_file
from engage_hri.services.perception.hearing.own_voice import VAIN, Canceller, CautiousJudge, OwnVoice
from engage_hri.services.perception.hearing.recognizing import (
    Answer,
    KnownWords,
    NotUnderstood,
    SpeechWords,
    settings_of,
)
from engage_hri.services.perception.hearing.turn_detectors import TurnDetectorSettings, TurnSound
from engage_hri.services.perception.hearing.voice import (
    LONGEST,
    End,
    Samples,
    VoiceBegan,
    VoiceEar,
    VoiceEnded,
    VoiceEvent,
    VoiceSound,
    silero,
)
from engage_hri.services.perception.sense_faults import SenseFaults
from engage_hri.services.runtime.installation import extra_command
from engage_hri.services.runtime.parcels import data_folder

VISITOR = "visitor"
"""Id of the person who speaks where nobody tells of any."""
STRANGER = "voice"
"""What an id begins with of which a number follows, of a voice of which it is not known whose it is."""
LIPS_LATE: Seconds = 0.5
"""Time after a voice within which pictures that were taken meanwhile are looked at."""
BEFORE_SPEECH: Seconds = 1.0
"""Time before the robot speaks from which on sound of its voice is that of this speech."""
ECHO: Seconds = 0.2
"""Time for which the robot's voice goes on in the room, and in the devices, when it has ended."""
WHOLE: Seconds = 5.0
"""Time without loss after which a loss is told again."""
LAST_WORDS: Seconds = 25.0
"""Time that the words of a file may take when it is over."""


def is_cancelling(config: HearingConfig) -> bool:
    """Tell whether the robot's own voice is taken out of the sound: where it is recorded now, unless it is set."""
    return config.is_deaf_while_robot_speaks is None and not is_file(config.source)


class _Speech:
    """A speech that goes on, or whose words are awaited. number: for the recognizer. since: loop time of its onset.

    utterance: as it was told last. until: loop time at which it had ended. whose: id of the person whose voice it is,
    as lips show.
    """

    def __init__(self, number: int, utterance: Utterance, since: Seconds) -> None:
        self.number, self.utterance, self.since = number, utterance, since
        self.until: Seconds | None = None
        self.whose = ""


class SoundChannel:
    """A channel of sound. Made by `Speeches`. person: whose voice is in it; empty: that of the only person here.

    speech: what is being said; None also of a voice that is nobody's. canceller, judge: None: the robot's own voice
    stays in it. lossy: loop time at which some of its sound was lost last.
    """

    def __init__(self, person: str, pause: Seconds, own: OwnVoice | None) -> None:
        self.person = person
        self.canceller = None if own is None else Canceller(own)
        self.judge = None if self.canceller is None else CautiousJudge(silero(), self.canceller)
        self.ear = VoiceEar(self.judge or silero(), pause)
        self.speech: _Speech | None = None
        self.turn = TurnSound()
        self.lossy: Seconds = float("-inf")


class Speeches:
    """Speeches of all channels. recognizer: None: nobody understands words. detector: None: nobody judges ends."""

    def __init__(self, bus: Bus, config: HearingConfig, people: HeardPeople, faults: SenseFaults) -> None:
        """Raises InputRefused: there is no such recognizer, or a package is not installed."""
        self._bus, self._config, self._people, self._faults = bus, config, people, faults
        try:
            silero()
        except ModuleNotFoundError as error:
            raise InputRefused(Fault(reason=str(error), where="hearing", advice=extra_command("hearing"))) from error
        self._own_voice = OwnVoice() if is_cancelling(config) else None
        self._awaited: dict[int, _Speech] = {}
        """Speeches whose words are not known for good, by number."""
        self._all_known = asyncio.Event()
        self._numbers, self._strangers = count(1), count(1)
        self._lips = Lips()
        self._nobodys: list[_Speech] = []
        """Speeches of which lips may still show whose they are."""
        self._robot_speaks = float("-inf"), float("-inf")
        """Since when the robot speaks, or has spoken last, and until when."""
        self._judged: dict[int, _Speech] = {}
        """Speeches of which it is judged by their sound whether they end a turn, by number."""
        self.recognizer = self.detector = None
        is_real = abs(self._bus.now() - time.monotonic()) < 1.0
        kind: type[InItsOwn | InThisProcess] = InItsOwn if is_real else InThisProcess
        if config.recognizer:
            self.recognizer = kind(Order(config.recognizer, settings_of(config)), self._answered)
        if config.turn_detector:
            folder = str(data_folder("hearing"))
            asked = TurnDetectorSettings(language=config.language, model=config.turn_model, folder=folder)
            self.detector = kind(DetectorOrder(config.turn_detector, asked), self._is_judged)

    async def made(self) -> None:
        """Wait until the recognizer and the detector are there. Raises InputRefused: one cannot be made."""
        for each in self._helpers:
            await each.made()

    @property
    def _helpers(self) -> list[Understanding]:
        return [each for each in (self.recognizer, self.detector) if each is not None]

    def channel(self, person: str) -> SoundChannel:
        """Make a channel. person: whose voice is in it; empty: that of the only person here."""
        return SoundChannel(person, self._config.pause, self._own_voice)

    def take(self, message: Message) -> None:
        """Take what is told of the robot's own voice, and of people's lips."""
        match message:
            case HeadPose(actor=actor, mouth=float() as mouth, at=at):
                self._lips.see(actor, mouth, self._bus.local(at))
                self._look_whose(self._bus.now())
            case ActionBegan(actor=self._bus.robot, action="speak", at=at):
                self._robot_speaks = self._bus.local(at), float("inf")
            case ActionEnded(actor=self._bus.robot, action="speak", at=at):
                self._robot_speaks = self._robot_speaks[0], self._bus.local(at) + ECHO
            case SoundFrame() if self._own_voice is not None:
                samples = np.frombuffer(message.samples, "<i2")
                self._own_voice.take(samples, message.rate, self._bus.local(message.at))

    def feed(self, channel: SoundChannel, samples: Samples, at: Seconds) -> None:
        """Let a channel have more sound. at: loop time at which its first sample was captured."""
        if self._is_deaf(at):
            samples = np.zeros_like(samples)
        if channel.canceller is not None and channel.judge is not None:
            samples, at = channel.canceller.feed(samples, at)
            if channel.judge.in_vain > VAIN:
                reason = "the robot's own voice cannot be taken out of the sound: nobody is heard while it speaks"
                advice = "use a headset, or the page that plays it"
                self._faults.tell_once(Fault(reason=reason, where="hearing", advice=advice))
        if not channel.person:
            self._lips.hear(samples, at)
        self._tell(channel, channel.ear.feed(samples, at))

    def lose(self, channel: SoundChannel) -> None:
        """Take it that no more sound comes from a channel: what was being said has ended."""
        self._tell(channel, channel.ear.lose())

    async def known(self) -> None:
        """Wait until all words are known, for a while."""
        if self._awaited:
            self._all_known.clear()
            try:
                async with asyncio.timeout(LAST_WORDS):
                    await self._all_known.wait()
            except TimeoutError:
                pass

    def close(self) -> None:
        """End the recognizer and the detector."""
        for each in self._helpers:
            each.close()

    # -- voices -------------------------------------------------------------------------------------------------

    def _tell(self, channel: SoundChannel, events: Iterable[VoiceEvent]) -> None:
        for event in events:
            match event:
                case VoiceBegan(at=at):
                    channel.speech = self._began(channel, at)
                    channel.turn.begin(at)
                case VoiceSound(samples=samples) if channel.speech is not None:
                    if self.recognizer is not None:
                        self.recognizer.hear(channel.speech.number, _bytes(samples))
                    if self.detector is not None:
                        channel.turn.hear(samples)
                case VoiceEnded(at=at, why=why) if (speech := channel.speech) is not None:
                    channel.speech = None
                    self._ended(speech, at)
                    self._tell_cut(channel, speech.utterance.actor, why)
                    if self.detector is not None:
                        self._judged[speech.number] = speech
                        self.detector.hear(speech.number, _bytes(channel.turn.end(at)))
                        self.detector.hear(speech.number, b"")

    def _began(self, channel: SoundChannel, at: Seconds) -> _Speech | None:
        if (person := self._speaker(channel)) is None:
            return None
        if is_nobodys := person == STRANGER:
            person = f"{STRANGER}_{next(self._strangers)}"
            # Another life of this program may have had the id for somebody else.
            self._people.perceived.tell(ActorFound(actor=person, at=self._bus.stamp(at), same_as=person))
        else:
            self._people.bring(person, at)
        number, stamp = next(self._numbers), self._bus.stamp(at)
        words = Utterance(actor=person, id=f"{self._bus.run}-{number}", text="", began=stamp, at=stamp, final=False)
        speech = _Speech(number, words, at)
        if is_nobodys:
            self._nobodys.append(speech)
        if self.recognizer is not None:
            self._awaited[number] = speech
            self._bus.publish(keys.UTTERANCE, words)  # first, so that whoever waits knows that words will come
        self._people.perceived.tell(ActionBegan(actor=person, action="speak", at=stamp))
        return speech

    def _ended(self, speech: _Speech, at: Seconds) -> None:
        stamp, speech.until = self._bus.stamp(at), at
        speech.utterance = replace(speech.utterance, ended=stamp)
        self._people.perceived.tell(ActionEnded(actor=speech.utterance.actor, action="speak", at=stamp))
        if self.recognizer is not None:
            self.recognizer.hear(speech.number, b"")

    def _tell_cut(self, channel: SoundChannel, person: str, why: End) -> None:
        """Tell that a speech has ended otherwise than with a pause, unless somebody else tells why no more comes."""
        if why == "gap":
            reason = f"a speech of {person} has ended where some of its sound is missing"
            advice = "sound is lost on its way, or the clock that tells its instants has jumped"
            self.tell_loss(channel, Fault(reason=reason, where="hearing", advice=advice))
        elif why == "long":
            reason = f"a voice of {person} goes on for {LONGEST:g} s without a pause: it is told as several speeches"
            advice = "is it noise, or music? a shorter hearing.pause finds more pauses"
            self._faults.tell_once(Fault(reason=reason, where="hearing", advice=advice))

    def tell_loss(self, channel: SoundChannel, fault: Fault) -> None:
        """Tell that sound of a channel is lost, unless some was lost, and that told, a moment ago."""
        now = self._bus.now()
        if now - channel.lossy > WHOLE:
            self._faults.tell(fault)
        channel.lossy = now

    def _speaker(self, channel: SoundChannel) -> str | None:
        """The person whose voice this is; `STRANGER`: lips will show it. None: it cannot be told of several."""
        if channel.person:
            return channel.person
        here = self._people.here
        if len(here) > 1 and self._lips.are_seen(self._bus.now()):
            return STRANGER
        if len(here) > 1:
            reason = f"whose voice it is cannot be told: {', '.join(here)} are here, and there is one channel"
            advice = "name one person for each channel, or let eyes see their lips: engage run eyes"
            self._faults.tell_once(Fault(reason=reason, where="hearing.people", advice=advice))
            return None
        return here[0] if here else VISITOR

    def _look_whose(self, now: Seconds) -> None:
        """Tell of whom it is that they speak, as far as lips show it."""
        for speech in [*self._nobodys]:
            who, voice = self._lips.speaker(speech.since, speech.until or now), speech.utterance.actor
            if who and who != speech.whose:
                speech.whose = who
                self._people.perceived.tell(ActorFound(actor=voice, at=self._bus.stamp(now), same_as=who))
            if speech.until is not None and now > speech.until + LIPS_LATE and speech.number not in self._awaited:
                self._nobodys.remove(speech)
                if not speech.whose:
                    self._people.perceived.tell(ActorLost(actor=voice, at=self._bus.stamp(now)))

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
        self._faults.tell_once(Fault(reason=reason, where="hearing", advice=advice))
        return True

    # -- words --------------------------------------------------------------------------------------------------

    def _answered(self, answer: Answer) -> None:
        speech = self._awaited.get(answer.speech)
        if speech is None:
            return
        words, is_final = SpeechWords(""), True
        if isinstance(answer, KnownWords):
            words, is_final = answer.words, answer.final
        else:
            self._faults.tell(answer.fault)
        if is_final and len(words.text) > LONGEST_TEXT:
            reason = f"a speech of {len(words.text)} letters: those after the first {LONGEST_TEXT} are left out"
            self._faults.tell(Fault(reason=reason, where="hearing.recognizer"))
        now, before = self._bus.stamp(), speech.utterance
        ended = (before.ended or now) if is_final else before.ended
        speech.utterance = replace(
            before, text=words.text[:LONGEST_TEXT], at=now, ended=ended, final=is_final, confidence=words.confidence
        )
        self._bus.publish(keys.UTTERANCE, speech.utterance)
        if is_final:
            del self._awaited[answer.speech]
            if not self._awaited:
                self._all_known.set()

    def _is_judged(self, answer: Answer) -> None:
        """Tell with the words how sure it is that the person has finished."""
        speech = self._judged.pop(answer.speech, None)
        if isinstance(answer, NotUnderstood):
            self._faults.tell(answer.fault)
        elif speech is not None:
            speech.utterance = replace(speech.utterance, at=self._bus.stamp(), finished=answer.words.confidence)
            self._bus.publish(keys.UTTERANCE, speech.utterance)


def _bytes(samples: Samples) -> bytes:
    return samples.astype("<i2").tobytes()
