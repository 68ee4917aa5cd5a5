"""Memory of what one person has said: the latest speeches, and to whom each is, as soon as that is certain.

It is found by the rules of `addressing`, when the speech begins and with all that is heard of it later. Who has
answered the robot, and what becomes of a sound, says the talk, which tells it to the conversation in its order.
"""

from collections import deque
from math import inf

from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.addressing import (
    Addressees,
    FaceTimes,
    OwnSpeech,
    Spoken,
    certain,
    likely,
)
from engage_hri.services.recognition.events.history import Latest
from engage_hri.services.recognition.events.listener_sign import SignPart
from engage_hri.services.recognition.events.machine import EventWriter
from engage_hri.services.recognition.events.scene import SessionScene
from engage_hri.services.text.listening import says_words

LOOKS_KEPT = 16
"""Number of looks of each person that are remembered, for a speech that is told when it is over."""
SPEECHES_KEPT = 8
"""Number of speeches of each person of which words may still tell what they were, and for whom."""


class OwnSpeeches:
    """Speeches of one person: the one that goes on, and the latest."""

    def __init__(self, id: str, scene: SessionScene, config: RecognitionConfig, writer: EventWriter) -> None:
        self.going_on: OwnSpeech | None = None
        """The speech of the person that goes on."""
        self.looks: deque[tuple[Seconds, str]] = deque(maxlen=LOOKS_KEPT)
        """Whose face the person has looked at, and since when; "": nobody's."""
        self._id = id
        self._scene = scene
        self._config = config
        self._writer = writer
        self._latest: Latest[Seconds, OwnSpeech] = Latest(SPEECHES_KEPT)
        """By their starts."""

    # -- what is remembered -------------------------------------------------------------------------------------

    def begin(self, since: Seconds, confidence: Probability, face: str) -> OwnSpeech:
        """Begin to remember a speech. face: whose face the person looks at now."""
        faces = FaceTimes(since)
        for at, looked_at in self.looks:
            faces.turns(looked_at, at)
        faces.face = face
        speech = OwnSpeech(actor=self._id, since=since, part=SignPart("speak", since, confidence), faces=faces)
        self.remember(speech)
        return speech

    def remember(self, speech: OwnSpeech) -> None:
        self._latest[speech.since] = speech
        if speech.until is None:
            self.going_on = speech

    def find(self, since: Seconds) -> OwnSpeech | None:
        """The speech that began then; None: it is not known, or long ago."""
        return self._latest.get(since)

    def in_order(self) -> list[OwnSpeech]:
        return sorted(self._latest.values(), key=lambda each: each.since)

    def has_said(self, since: Seconds, until: Seconds | None = None, but: Spoken | None = None) -> bool:
        """True if the person has said anything else at this time, as far as it is remembered."""
        said = [each for each in (*self._scene.spoken, *self._latest.values()) if each.actor == self._id]
        return any(each is not but and each.overlaps(since, until) for each in said)

    def rename(self, other: str, kept: str) -> None:
        """Take the face of somebody for that of who they turn out to be."""
        self.looks = deque(((at, kept if face == other else face) for at, face in self.looks), LOOKS_KEPT)
        for speech in self._latest.values():
            speech.faces.rename(other, kept)

    def forget(self) -> None:
        """Forget what the person has said before they left."""
        self._latest.clear()

    # -- what a speech is, and to whom --------------------------------------------------------------------------

    def hear(self, speech: OwnSpeech, words: str, told: Addressees | None, at: Seconds) -> None:
        """Take the words of a speech. told: addressees, if perception knows them."""
        if says_words(words):
            speech.worded_at = at if speech.worded_at == -inf else speech.worded_at
        speech.words, speech.told = words or speech.words, told or speech.told

    def is_certain(self, speech: OwnSpeech, at: Seconds) -> bool:
        """Decide to whom the speech is if that is certain."""
        speech.company |= self._scene.company(self._id)
        is_line = self._scene.lines.get(self._id) == speech.since
        to = certain(speech, self._scene.robot, self._scene.names, is_line=is_line)
        if to is not None and to != speech.to:
            self.address(speech, to, at)
        return to is not None

    def address(self, speech: OwnSpeech, to: Addressees, at: Seconds) -> None:
        """Take it that the speech is for these."""
        speech.to = to
        if self._scene.robot not in to:
            self._writer.decide_interjection(self._id, speech.since, "other", at)
        elif speech.until is None:
            self.may_interrupt(speech, "", at)
        self._scene.note_spoken(speech, at)

    def may_interrupt(self, speech: OwnSpeech, face: str, at: Seconds) -> None:
        """Tell of a speech into the robot's turn, unless it is for somebody else, or looks like that.

        Of one into its words to others that is told when it is known to be for the robot.
        """
        is_aside = face not in ("", self._scene.robot) if speech.to is None else not speech.is_to(self._scene.robot)
        is_for_robot = speech.is_beside and speech.is_to(self._scene.robot)
        if (speech.is_into_turn or is_for_robot) and not is_aside:
            self._writer.interject(self._id, speech.since, "open", at)

    def likely(self, speech: OwnSpeech, at: Seconds, awaited_by: Addressees) -> Addressees:
        """Addressees of a speech by what is likely at `at`. awaited_by: who waits for the person's answer."""
        if speech.until is None:
            speech.faces.turns(speech.faces.face, at)
        is_untold = self._scene.tells_addressees and not says_words(speech.words)
        within = self._config.adjacency_pair_limit
        return likely(speech, self._scene.spoken, by=at, within=within, awaited_by=awaited_by, is_untold=is_untold)
