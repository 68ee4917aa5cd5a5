"""A person as the robot's listener: the sign that is open, and what became of those before. Pure.

A sign is decided once, by rules (`listener_sign`). But words may come after that: a slow recognizer tells "stop" when
the sound has been taken for a cough, and "yes, yes, okay" when it was too long for a listener's. And of a voice in
which only the robot's own words were heard, the person's words may come next. So what each speech was taken for is
remembered, and words correct it:

| taken for | a listener's words make it | other words make it | as long as |
|---|---|---|---|
| noise, or the robot's own words | a backchannel | a turn | the turn goes on, or neither has spoken since |
| a backchannel | | a turn | the turn goes on |
| a turn: the answer into the turn | a backchannel | | the turn goes on |

The turn is that of the robot in which it was said. When that is over what has been told stays, and what was noise,
so that nothing has been told, is as any sound whose words come late (decision 0199). If somebody has spoken since it
says nothing any more: an old "stop" would answer what was asked after it. Of who stands by, and says something while
the robot speaks to others, nothing is in a turn of theirs.
"""

from collections.abc import Sequence
from math import inf

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.recognition import InterjectionReading
from engage_hri.schemas.units import Seconds
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.addressing import WORDS_AFTER
from engage_hri.services.recognition.events.backchannel import Backchannel
from engage_hri.services.recognition.events.exchange import Exchange
from engage_hri.services.recognition.events.listener_sign import WORDS_WAIT, ListenerSign, SignPart
from engage_hri.services.recognition.events.machine import EventWriter, OngoingEvent, SpeechStart
from engage_hri.services.recognition.events.scene import SessionScene
from engage_hri.services.text.listening import is_listening, says_words


class Listener:
    """The signs of one person while the robot has the floor. exchange: the turns of the two."""

    def __init__(
        self, id: str, scene: SessionScene, config: RecognitionConfig, writer: EventWriter, exchange: Exchange
    ) -> None:
        self._id = id
        self._scene = scene
        self._config = config
        self._writer = writer
        self._exchange = exchange
        self._backchannel = Backchannel(writer, limit=config.backchannel_limit)
        self.sign: ListenerSign | None = None
        """What the person does in the robot's turn, as long as it is not decided what it is."""
        self._interrupting = ListenerSign([])
        """The sign that has taken the floor: as long as the turn goes on, words may show that it was a listener's."""

    # -- a sign -------------------------------------------------------------------------------------------------

    def begins(self, part: SignPart, *, beside: bool = False) -> None:
        """Take a part of the sign that goes on, or of a new one. beside: the robot speaks to others."""
        self.next_begins()
        self._joins([part], beside=beside)
        self.judge(part.since)  # what is told late may have its words

    def next_begins(self) -> None:
        """Decide the sign if it is over: its words have not come until the next one begins, or the robot's turn."""
        if self.sign is not None:
            self._has_no_words(self.sign, self._writer.now)

    def goes_with_words(self, part: SignPart) -> None:
        """Take a gesture beside words that have the floor: it says nothing, unless these turn out a listener's."""
        if self._interrupting.going_on("speak"):
            self._interrupting.parts.append(part)

    def _joins(self, parts: Sequence[SignPart], *, beside: bool = False) -> None:
        if self.sign is None:
            self.sign = ListenerSign([], is_beside=beside)
        self.sign.parts += parts
        self.sign.is_wordless = False  # this one's words may come

    def listens_to(self, part: SignPart) -> bool:
        """True if this is part of the sign."""
        return self.sign is not None and any(each is part for each in self.sign.parts)

    @property
    def is_beside(self) -> bool:
        """True while a sign is open that has begun beside the robot's words to others."""
        return self.sign is not None and self.sign.is_beside

    @property
    def beside_since(self) -> Seconds | None:
        """Start of what the person says while the robot speaks to others, as long as it may be a turn."""
        sign = self.sign
        is_none = sign is None or not sign.is_beside or all(map(self._is_echo, sign.speeches))
        return None if sign is None or is_none else sign.since

    def ends(self, action: Action, at: Seconds) -> None:
        """End an action of the person."""
        for part in (*self._interrupting.parts, *(self.sign.parts if self.sign is not None else ())):
            part.until = at if part.until is None and part.action == action else part.until
        self.judge(at)

    def person_gone(self, at: Seconds, until: Seconds) -> None:
        if self.sign is not None and self.sign.outlasting is not None:
            self._takes_floor(self.sign.outlasting, until, "answer")
        sign, self.sign = self.sign, None
        if sign is not None and not sign.speeches:
            self._listens(sign, until)
        for speech in sign.speeches if sign is not None else ():
            self._tell(speech, at)

    # -- what decides it ----------------------------------------------------------------------------------------

    @property
    def deadline(self) -> Seconds:
        """Time at which the sign is decided by its length, or for want of words; infinite: it is not."""
        sign = self.sign
        if sign is None or (sign.speeches and self._asks_for_nothing(sign.speeches[-1])):
            return inf
        waits = sign.is_beside and self._scene.is_worded
        return sign.deadline(self._scene.longest_unknown, WORDS_AFTER) if waits else sign.deadline(self.longest)

    @property
    def waits_until(self) -> Seconds:
        """Time until which a sign that is over waits for its words, whatever has come since; infinite: none does."""
        return inf if self.sign is None or self.sign.until is None else self.deadline

    @property
    def longest(self) -> Seconds:
        """Time after which a voice that goes on in the robot's turn is no listener's, if it has no words."""
        return WORDS_WAIT if self._scene.is_worded else self._config.backchannel_limit

    def pass_time(self, at: Seconds) -> None:
        """Decide the sign: its speech has become too long for a backchannel, or its words have not come."""
        assert self.sign is not None
        if speech := self.sign.going_on("speak"):
            self._takes_floor(speech[0], at, "interruption")
        else:
            self.sign.is_wordless = True
            self.judge(at)

    def judge(self, at: Seconds) -> None:
        """Decide the sign, if what is known leaves one reading of it."""
        sign = self.sign
        if sign is None:
            return
        interrupts = next((speech for speech in sign.speeches if self._is_listening(speech) is False), None)
        is_known = not self._scene.is_worded or sign.is_wordless or all(map(self._asks_for_nothing, sign.speeches))
        if interrupts is not None:
            self._takes_floor(interrupts, at, "interruption")
        elif is_known:
            self._has_no_words(sign, at)

    def _has_no_words(self, sign: ListenerSign, at: Seconds) -> None:
        """Decide a sign of which no words say anything, unless it goes on in the robot's turn."""
        if sign.outlasting is not None:
            self._takes_floor(sign.outlasting, at, "answer")
        elif sign.until is not None:
            self._listens(sign, sign.until)

    def robots_turn_ends(self, at: Seconds, reading: InterjectionReading = "answer") -> None:
        """Take what goes on of the sign for the answer, because the robot's turn is over.

        Of several parts it is the one that began first. A gesture that answers nothing here stays what it is, as
        beside the robot's words to others, and one beside a speech whose words may come waits for them: that began
        before.
        """
        sign = self.sign
        for part in sign.going_on() if sign is not None else ():
            is_speech = part.action == "speak"
            may_answer = not self.is_beside and self._exchange.pair.may_be_answered_with(part.action)
            if not self._is_echo(part) if is_speech else may_answer:
                if sign and not is_speech and reading == "answer" and self._awaits_words_before(sign, part):
                    sign.outlasting = part
                else:
                    self._takes_floor(part, at, reading)
                return

    def _awaits_words_before(self, sign: ListenerSign, part: SignPart) -> bool:
        """True if words may still come of the last speech of the sign, and it did not begin after a part of it."""
        if not self._scene.is_worded or sign.is_wordless or not sign.speeches:
            return False
        speech = sign.speeches[-1]
        is_waiting = self._writer.now < speech.since + WORDS_WAIT
        return is_waiting and speech.since <= part.since and not self._asks_for_nothing(speech)

    def understand(self, speech: SignPart, at: Seconds, *, in_turn: bool, is_last: bool) -> None:
        """Judge a speech by its words.

        in_turn: the robot's turn goes on in which it was said. is_last: neither has begun to say anything since.
        """
        if self.listens_to(speech):
            if self._is_echo(speech):
                self._tell(speech, at)  # the robot need not wait until it is over
            self.judge(at)
            return
        listens, taken = self._is_listening(speech), speech.taken_for
        is_new = taken == "noise" and (in_turn or is_last)
        if listens is False and (is_new or (in_turn and taken == "backchannel")):
            is_into_words = in_turn or self._scene.robot_says(speech.since, at)
            self._is_turn(speech, "interruption" if is_into_words else "answer", at)
        elif listens and (is_new or self._exchange.pair.was_listening(speech.since)):
            sign = self._interrupting if speech in self._interrupting.parts else ListenerSign([speech])
            if sign.until is None:
                self._joins(sign.parts)
            else:
                self._listens(sign, sign.until)
        elif listens and in_turn and (taken == "backchannel" or (taken and self._exchange.pair.is_interrupted)):
            self._tell(speech, at)  # it is that of the nod beside it, or more of the answer, which have been told

    # -- what it is ---------------------------------------------------------------------------------------------

    def _listens(self, sign: ListenerSign, until: Seconds) -> None:
        """Take the sign for a backchannel, but for sounds without words: these are noise where words are told."""
        if sign is self.sign:
            self.sign = None
        for speech in sign.speeches:
            self._tell(speech, until)
            speech.taken_for = "noise" if self._is_noise(speech) else "backchannel"
        # A point in the robot's turn directs the gaze, and says nothing.
        parts = [part for part in sign.parts if part.taken_for != "noise" and part.action != "point"]
        if not parts:
            return
        told = ListenerSign(parts)
        self._backchannel.begin(
            OngoingEvent(
                kind="backchannel", initiator=self._scene.robot, responder=self._id, started=told.since,
                confidence=told.confidence,
                spoken=tuple(SpeechStart(self._id, speech.since) for speech in told.speeches),
            ),
            "speaks",
        )  # fmt: skip
        self._backchannel.ends(until if told.until is None else told.until)
        for speech in sign.speeches:
            speech.taken_for = "backchannel"  # one sign gives one, also if words of it come later

    def _takes_floor(self, part: SignPart, at: Seconds, reading: InterjectionReading) -> None:
        """Take a part of the sign as a turn of the person since it began. Speech before it was a listener's."""
        beside: list[Seconds] = []
        sign, self.sign = self.sign, None
        assert sign is not None
        for speech in sign.speeches:
            if speech.since <= part.since and speech is not part:
                self._tell(speech, at)
            elif speech is not part:  # it goes on beside the gesture that answers, and is of that answer
                self._read(speech.since, reading, at)
                beside.append(speech.since)
        if not self._exchange.pair.is_interrupted:
            self._interrupting = sign
        self._is_turn(part, reading, at, beside)

    def _is_turn(
        self, part: SignPart, reading: InterjectionReading, at: Seconds, beside: Sequence[Seconds] = ()
    ) -> None:
        """Take a part as a turn. beside: starts of what is said with it."""
        if part.action == "speak":
            self._read(part.since, reading, at)
        part.taken_for = "turn"
        self._exchange.take(part, beside)

    def _tell(self, speech: SignPart, at: Seconds) -> None:
        """Tell that a speech was a listener's, or noise where its words would have come."""
        reading: InterjectionReading = "noise" if self._is_noise(speech) else "backchannel"
        self._read(speech.since, reading, at)

    def _read(self, since: Seconds, reading: InterjectionReading, at: Seconds) -> None:
        """Tell what a speech is, and remember it for what others say after it."""
        self._scene.read(self._id, since, reading, at)
        self._writer.interject(self._id, since, reading, at)

    # -- its words ----------------------------------------------------------------------------------------------

    def _is_listening(self, speech: SignPart) -> bool | None:
        """True if the words of a speech are a listener's; None: there are none, as far as is known."""
        return is_listening(speech.words) if says_words(speech.words) else None

    def _is_noise(self, speech: SignPart) -> bool:
        """True if no words of a speech are known, where they would be."""
        return self._scene.is_worded and self._is_listening(speech) is None

    def _is_echo(self, speech: SignPart) -> bool:
        """True if nothing but the robot's own words is known of a speech."""
        return (self._id, speech.since) in self._scene.echoes and self._is_listening(speech) is None

    def _asks_for_nothing(self, speech: SignPart) -> bool:
        """True if a speech is known to be no turn: by a listener's words, or because it is the robot's own words."""
        return bool(self._is_listening(speech)) or self._is_echo(speech)
