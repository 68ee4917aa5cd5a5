"""Conversation of a person and the robot: speech, gestures and manipulations, turn by turn.

They are input of the adjacency pair and of the two backchannels, the person's own and the robot's.
"""

from collections.abc import Iterator
from math import inf

from engage_hri.schemas.behaviors import Action, Cause
from engage_hri.schemas.recognition import InterjectionReading
from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.addressing import WORDS_AFTER
from engage_hri.services.recognition.events.adjacency_pair import INTERRUPTED, RESPONDING, AdjacencyPair
from engage_hri.services.recognition.events.backchannel import BRIEF, UNDECIDED, Backchannel
from engage_hri.services.recognition.events.history import Latest
from engage_hri.services.recognition.events.limits import in_time
from engage_hri.services.recognition.events.listener_sign import WORDS_WAIT, ListenerSign, SignPart
from engage_hri.services.recognition.events.machine import IDLE, EventWriter, OngoingEvent, SpeechStart
from engage_hri.services.recognition.events.presence import NEVER
from engage_hri.services.recognition.events.scene import SessionScene
from engage_hri.services.text.listening import is_listening, says_words

TURN_PATIENCE: Seconds = 12.0
"""Time after the robot's last word for which its unfinished turn still counts; longer than the silence after which
generation closes a turn (10 s). Also the time, after the limit, for which an anchor that does not come is waited for.
Ours."""


SPEECHES_KEPT = 8
"""Number of speeches of which words may still tell that they were a listener's."""


class Conversation:
    """Conversation of one person with the robot."""

    def __init__(self, id: str, scene: SessionScene, config: RecognitionConfig, writer: EventWriter) -> None:
        self.id = id
        self.speaks_since: Seconds | None = None
        self.silent_since: Seconds | None = None
        self.pair = self._new_pair(writer, config)
        self._cut_into: list[tuple[AdjacencyPair, str]] = []
        """Pairs of the person whose first turn still goes on although the robot has answered with a first turn of its
        own, each with the block of that turn."""
        self.own_backchannel = Backchannel(writer, limit=config.backchannel_limit)
        self.robot_backchannel = Backchannel(writer, limit=config.backchannel_limit)
        self.robot_speaks_since = scene.robot_speaks_to(id)
        """Time when the robot began what it says to this person now; None: it says nothing to them."""
        self._speech_confidence: Probability = 1.0
        self._turned_at: Seconds = NEVER
        """Time when the person, or the robot to the person, has last begun to say something."""
        self._speeches: Latest[Seconds, Seconds | None] = Latest(SPEECHES_KEPT)
        """Ends of the person's latest speeches, by their starts; None: it goes on."""
        self._sign: ListenerSign | None = None
        """What the person does in the robot's turn, as long as it is not decided what it is."""
        self._brief: Latest[Seconds, tuple[Seconds | None, bool]] = Latest(SPEECHES_KEPT)
        """Speeches of the person within the robot's turn that have been no answer so far, by their starts: the end,
        and whether they were noise."""
        self._echo: SignPart | None = None
        """The last of what was nothing but the robot's own words in its turn. More words of it may come."""
        self._scene = scene
        self._config = config
        self._writer = writer

    @staticmethod
    def _new_pair(writer: EventWriter, config: RecognitionConfig) -> AdjacencyPair:
        return AdjacencyPair(
            writer, limit=config.adjacency_pair_limit, third_turn=config.third_turn_limit,
            patience=TURN_PATIENCE,
        )  # fmt: skip

    @property
    def deadline(self) -> Seconds:
        """Time of the next step that is due by itself; infinite: there is none."""
        due = inf if self.pair.event is None else self._pair_deadline
        if self._sign is not None or self.robot_backchannel.event is not None:
            due = min(due, self._sign_deadline, self.robot_backchannel.deadline)
        return due

    def pass_time(self, at: Seconds) -> None:
        """Take the first step that is due at `at`, the `deadline`."""
        if self._sign_deadline == at:
            self._sign_is_due(at)
        elif self.robot_backchannel.deadline == at:
            self._robot_takes_floor(at)
        else:
            self.pair.expire(at)

    @property
    def _pair_deadline(self) -> Seconds:
        """Deadline of the pair; infinite while speech of anybody that began in time may yet be part of it."""
        pair, sign, at = self.pair, self._sign, self.pair.deadline
        if at == inf or pair.is_interrupted:
            return at
        began_in_time = sign is not None and any(in_time(speech.since, at) for speech in sign.speeches)
        if began_in_time and pair.may_go_on_with("speak"):
            return inf
        return inf if self._scene.may_be_answered(self.id, at) and pair.question is not None else at

    def person_gone(self, at: Seconds, until: Seconds) -> None:
        for pair in self._pairs():
            pair.person_gone(at, until)
        if self._sign is not None and not self._sign.speeches:
            self._was_backchannel(self._sign, until)
        for speech in self._sign.speeches if self._sign is not None else ():
            self._tell_listening(speech, at)
        self._sign = None
        self.robot_backchannel.person_gone(at, until)
        self.speaks_since = None
        self.silent_since = until

    # -- the person ---------------------------------------------------------------------------------------------

    @property
    def robot_holds_floor(self) -> bool:
        return self.robot_speaks_since is not None or self.pair.robot_holds_turn

    def is_into_turn(self, at: Seconds) -> bool:
        """True if what the person does at `at` is in the robot's turn. It may be known only now, and be earlier."""
        if self.pair.event is not None and self.pair.robot_holds_turn:
            return at >= self.pair.event.started
        return self.robot_speaks_since is not None and at >= self.robot_speaks_since

    @property
    def is_spoken_to(self) -> bool:
        """True while the robot speaks to the person, or waits for an answer."""
        return self.robot_holds_floor or self.pair.may_be_answered_with("speak")

    @property
    def holds_floor(self) -> bool:
        return self.speaks_since is not None

    @property
    def takes_floor_since(self) -> Seconds:
        """Start of what the person says now, or has answered into the robot's turn; infinite: of nothing."""
        if (answered := self.pair.interrupted_since) is not None:
            return answered
        return inf if self.speaks_since is None else self.speaks_since

    @property
    def is_under_way(self) -> bool:
        """True if one holds the floor, or a pair, a sign or a backchannel is open."""
        is_open = self.pair.event is not None or self.robot_backchannel.event is not None or self._cut_into
        return self.robot_speaks_since is not None or self.holds_floor or self._sign is not None or bool(is_open)

    def speaks(self, at: Seconds, confidence: Probability = 1.0, *, beside: bool = False) -> None:
        """Take the beginning of speech. beside: the robot says something to others."""
        if self.speaks_since is not None:
            return
        self.speaks_since, self.silent_since = at, None
        self._speeches[at] = None
        self._speech_confidence = confidence
        if self.is_into_turn(at) or beside:
            self._writer.interject(self.id, at, "open", at)
            # A line that was typed has no length by which it could be judged: who sends one has something to say.
            if self._scene.lines.get(self.id) != at:
                self._signs("speak", at, confidence, beside=not self.robot_holds_floor)
                return
            self._writer.interject(self.id, at, "interruption", at)
        else:
            self._writer.decide_interjection(self.id, at, "answer", at)
            self.next_sign_begins()
        if not self._is_before_question(at):
            self._human_turn(at, "speak", confidence)
            self._robot_has_answered(at)
        self._turned_at = at

    def _is_before_question(self, at: Seconds) -> bool:
        """True if what the person has said at `at` is known only now, and the robot has begun another pair since."""
        return self.pair.event is not None and self.pair.may_be_answered and at < self.pair.event.started

    def _robot_has_answered(self, at: Seconds) -> None:
        """Take what the robot says now for the answer to what the person has begun to say before, at `at`."""
        if self.robot_speaks_since is not None and at < self.robot_speaks_since:
            self.pair.robot_begins("speak", self.robot_speaks_since)

    def has_said(self, since: Seconds, until: Seconds, confidence: Probability) -> None:
        """Take speech that is over, known only now. It says nothing any more if either has spoken since."""
        if self._turned_at < since and self.speaks_since is None:
            self.silent_since = until
            self._human_turn(since, "speak", confidence)

    def falls_silent(self, at: Seconds) -> None:
        if self.speaks_since is None:
            return
        self._speeches[self.speaks_since] = at
        self.speaks_since, self.silent_since = None, at
        self._ends("speak", at, by_robot=False)
        self._floor_is_free(at)

    def gestures(self, action: Action, at: Seconds, confidence: Probability = 1.0) -> None:
        """Take a nod, a shake or a point of the person."""
        if self.holds_floor and (self._sign is None or not self._sign.going_on("speak")):
            return  # it goes with the person's own words, and says nothing more
        if self.robot_holds_floor or (self._sign is not None and self._sign.until is None):
            self._signs(action, at, confidence)
        elif not self.pair.human_begins(action, at, confidence):
            self.pair.answers_late(action, at, confidence)

    def action_ends(self, action: Action, at: Seconds) -> None:
        """Take the end of a gesture, or of a manipulation."""
        self._ends(action, at, by_robot=False)

    # -- signs in the robot's turn ------------------------------------------------------------------------------

    def _signs(self, action: Action, at: Seconds, confidence: Probability, *, beside: bool = False) -> None:
        self.next_sign_begins()
        self._turned_at = at
        self._joins(SignPart(action, at, confidence), beside=beside)

    def next_sign_begins(self) -> None:
        """Decide the sign if it is over: its words have not come until the next one begins."""
        if self._sign is not None and self._sign.until is not None:
            self._judge(self._sign.until)
        if self._sign is not None and self._sign.until is not None:
            self._was_backchannel(self._sign, self._sign.until)

    def _joins(self, part: SignPart, *, beside: bool = False) -> None:
        """Make a part of the sign that goes on, or of a new one."""
        if self._sign is None:
            self._sign = ListenerSign([], is_beside=beside)
        self._sign.parts.append(part)
        self._sign.is_wordless = False  # this one's words may come

    @property
    def _sign_deadline(self) -> Seconds:
        sign = self._sign
        if sign is None or (sign.speeches and self._asks_for_nothing(sign.speeches[-1].since)):
            return inf
        if not self._scene.is_worded:
            return sign.deadline(self._config.backchannel_limit)
        if sign.is_beside:
            return sign.deadline(self._scene.longest_unknown, WORDS_AFTER)
        return sign.deadline(WORDS_WAIT)

    @property
    def beside_since(self) -> Seconds | None:
        """Start of what the person says while the robot speaks to others, as long as it may be a turn."""
        sign = self._sign
        if sign is None or not sign.is_beside or all(self._is_echo(speech.since) for speech in sign.speeches):
            return None
        return sign.since

    def _sign_is_due(self, at: Seconds) -> None:
        """Decide the sign: its speech has become too long for a backchannel, or its words have not come."""
        assert self._sign is not None
        if speech := self._sign.going_on("speak"):
            self._answers(speech[0], at)
        else:
            self._sign.is_wordless = True
            self._judge(at)

    def _judge(self, at: Seconds) -> None:
        """Decide the sign, if what is known leaves one reading of it."""
        sign = self._sign
        if sign is None:
            return
        speeches = sign.speeches
        interrupts = next((speech for speech in speeches if self._listens(speech.since) is False), None)
        is_heard = all(self._asks_for_nothing(speech.since) for speech in speeches)
        is_known = not self._scene.is_worded or sign.is_wordless or is_heard
        if interrupts is not None:
            self._answers(interrupts, at)
        elif sign.until is not None and is_known:
            self._was_backchannel(sign, sign.until)

    def _was_backchannel(self, sign: ListenerSign, until: Seconds) -> None:
        """Take the sign for a backchannel, but for sounds without words: these are noise where words are told."""
        if sign is self._sign:
            self._sign = None
        for speech in sign.speeches:
            self._tell_listening(speech, until)
            if self._is_echo(speech.since):
                self._echo = speech
            self._brief[speech.since] = speech.until, self._is_noise(speech.since)
        parts = [part for part in sign.parts if part.action != "speak" or not self._is_noise(part.since)]
        if all(part.action == "point" for part in parts):
            return  # a point in the robot's turn directs the gaze, and says nothing
        told = ListenerSign(parts)
        event = self._backchannel(self._scene.robot, self.id, told.since, told.confidence)
        event.spoken = tuple(SpeechStart(self.id, speech.since) for speech in told.speeches)
        self.own_backchannel.speaks(event)
        self.own_backchannel.ends(until if told.until is None else told.until)

    def _is_noise(self, since: Seconds) -> bool:
        """True if no words of a speech are known, where they would be."""
        return self._scene.is_worded and not says_words(self._writer.text_of(self.id, since))

    def _tell_listening(self, speech: SignPart, at: Seconds) -> None:
        """Tell that a speech was a listener's, or noise where its words would have come."""
        reading: InterjectionReading = "noise" if self._is_noise(speech.since) else "backchannel"
        self._writer.interject(self.id, speech.since, reading, at)

    def _answers(self, part: SignPart, at: Seconds, reading: InterjectionReading = "interruption") -> None:
        """Take a part of the sign as a turn of the person since it began. Speech before it was a listener's."""
        for speech in self._sign.speeches if self._sign is not None else ():
            if speech.since < part.since:
                self._tell_listening(speech, at)
        self._sign = None
        if part.action == "speak":
            self._writer.interject(self.id, part.since, reading, at)
            if not self._is_before_question(part.since) and part.since >= self.pair.interrupted_until:
                self._human_turn(part.since, "speak", part.confidence)
        elif self.pair.human_begins(part.action, part.since, part.confidence) and part.until is not None:
            self.pair.ends(part.action, part.until, by_robot=False)

    def _keep_floor(self, at: Seconds, reading: InterjectionReading = "answer") -> None:
        """Take what goes on of a sign for the answer, because the robot's turn is over.

        Of several parts it is the one that began first. A gesture that answers nothing here stays what it is.
        """
        for part in self._sign.going_on() if self._sign is not None else ():
            if part.action == "speak" and self._is_echo(part.since):
                continue
            if part.action == "speak" or self.pair.may_be_answered_with(part.action):
                self._answers(part, at, reading)
                return

    def understand(self, since: Seconds, at: Seconds) -> None:
        """Judge speech in the robot's turn by its words, if they are known before that or the sign is over.

        They may come when its length has already decided: a "stop" was too short for an answer, and "yes, yes, okay"
        too long for a backchannel.
        """
        if (speech := self._speech_of_sign(since)) is not None:
            if self._is_echo(since):
                self._tell_listening(speech, at)  # the robot need not wait until it is over
            self._judge(at)
            return
        listens = self._listens(since)
        until, was_noise = self._brief.get(since, (None, False))
        if self._echo is not None and self._echo.since == since and says_words(self._writer.text_of(self.id, since)):
            self._was_no_echo(self._echo, at, listens=listens)
        elif listens and (was_noise or self.pair.was_listening(since)):
            part = SignPart("speak", since, self._speech_confidence, self._speeches.get(since))
            if part.until is None:
                self._joins(part)
            else:
                self._was_backchannel(ListenerSign([part]), part.until)
        elif listens is False and since in self._brief:
            del self._brief[since]
            self._was_turn(SignPart("speak", since, self._speech_confidence, until), "interruption", at)

    def _was_no_echo(self, part: SignPart, at: Seconds, *, listens: bool | None) -> None:
        """Take what was nothing but the robot's words for speech: the person's have come."""
        self._echo = None
        if listens:
            assert part.until is not None
            self._was_backchannel(ListenerSign([part]), part.until)
        else:
            self._was_turn(part, "interruption" if listens is False else "answer", at)

    def _was_turn(self, speech: SignPart, reading: InterjectionReading, at: Seconds) -> None:
        """Take a speech for a turn of the person that was told as something else before."""
        self._writer.interject(self.id, speech.since, reading, at)
        self._human_turn(speech.since, "speak", speech.confidence)
        if speech.until is not None:
            self.pair.ends("speak", speech.until, by_robot=False)

    def _is_echo(self, since: Seconds) -> bool:
        """True if nothing but the robot's own words is known of a speech."""
        is_echo = (self.id, since) in self._scene.echoes
        return is_echo and not says_words(self._writer.text_of(self.id, since))

    def _listens(self, since: Seconds) -> bool | None:
        """True if the words of a speech are a listener's; None: they are unknown, or not said to the robot's turn."""
        words, event = self._writer.text_of(self.id, since), self.pair.event
        is_in_sign = self._speech_of_sign(since) is not None
        is_heard = (is_in_sign or self.robot_holds_floor) and (event is None or since >= event.started)
        if not says_words(words) or not is_heard:
            return None
        return is_listening(words)

    def _asks_for_nothing(self, since: Seconds) -> bool:
        """True if a speech is known to be no turn: by a listener's words, or because it is the robot's own words."""
        return bool(self._listens(since)) or self._is_echo(since)

    def _speech_of_sign(self, since: Seconds) -> SignPart | None:
        """The speech of the sign that began then; None: there is none."""
        speeches = () if self._sign is None else self._sign.speeches
        return next((speech for speech in speeches if speech.since == since), None)

    def resumes(self, event: OngoingEvent, at: Seconds) -> None:
        """Go on with a pair of a former life of recognition."""
        self.pair.resume(event, at, by_robot=event.responder == self.id)

    def manipulates(self, at: Seconds, confidence: Probability = 1.0) -> None:
        self._human_turn(at, "act", confidence)

    def goes_on(self, action: Action, since: Seconds, confidence: Probability) -> None:
        """Take an action of the person that goes on, known only now. It may be the answer, or more of a turn."""
        if action == "speak" and self.speaks_since is None:
            self.speaks_since, self.silent_since = since, None
        if self.pair.event is None or since < self.pair.event.started:
            return
        pair = self.pair
        is_answer = pair.human_begins(action, since, confidence) or pair.answers_late(action, since, confidence)
        if not is_answer and action in ("speak", "act"):
            pair.human_goes_on(action, since)

    def _human_turn(self, at: Seconds, action: Action, confidence: Probability) -> None:
        """Take speech that is no backchannel, or a manipulation: an answer, more of a turn, or a first turn."""
        pair = self.pair
        if pair.human_begins(action, at, confidence):
            pass
        elif pair.state in (INTERRUPTED, RESPONDING):
            return  # it is part of this exchange
        elif self._scene.answers_for_another(self.id, action, at, after=pair.asked_until):
            pair.forget_unanswered()
        elif pair.answers_late(action, at, confidence) or pair.human_goes_on(action, at):
            pass
        elif action == "speak" and pair.is_third_turn(self.id, at):
            pair.third_turn(at)
        elif pair.state == IDLE:
            event = OngoingEvent(
                kind="adjacency_pair", initiator=self.id, responder=self._scene.robot, started=at,
                limit=self._config.adjacency_pair_limit, confidence=confidence,
                spoken=(SpeechStart(self.id, at),) if action == "speak" else (),
            )  # fmt: skip
            pair.human_asks(event, action)
        if action == "speak" and self.speaks_since is None and self.silent_since is not None:
            self._ends("speak", self.silent_since, by_robot=False)

    # -- the robot ----------------------------------------------------------------------------------------------

    def robot_speaks(self, at: Seconds, *, listens: bool) -> None:
        """Take the beginning of the robot's speech. listens: it is a backchannel that was announced."""
        self.robot_speaks_since = self._turned_at = at
        self.pair.robot_heard(None)
        if self.holds_floor and not self.pair.robot_holds_turn:
            if self.robot_backchannel.state != BRIEF and not self.pair.is_cut_into:
                self.robot_backchannel.speaks(self._backchannel(self.id, self._scene.robot, at))
        elif not listens:
            self.pair.robot_begins("speak", at)
            self.pair.forget_unanswered()

    def robot_falls_silent(self, at: Seconds) -> None:
        self.robot_speaks_since = None
        if self._sign is not None and self._sign.is_beside:
            self._keep_floor(at)
        self.pair.robot_heard(at)
        listening, since = self.robot_backchannel, self.robot_backchannel.undecided_since
        if listening.state == BRIEF or (since is not None and in_time(at, since + self._config.backchannel_limit)):
            listening.ends(at)
        self._ends("speak", at, by_robot=True)
        self._floor_is_free(at)

    def robot_gestures(self, action: Action, at: Seconds, *, listens: bool) -> None:
        """Take a nod, a shake or a point of the robot. listens: it is a backchannel that was announced."""
        if not self.holds_floor or action == "point":
            if not listens:
                self.pair.robot_begins(action, at)
        elif self.robot_backchannel.state == IDLE:
            self.robot_backchannel.gestures(self._backchannel(self.id, self._scene.robot, at))

    def robot_goes_on(self, action: Action, since: Seconds) -> None:
        """Take speech or a gesture of the robot that goes on, known only now. It may be the answer."""
        if action == "speak":
            self.robot_speaks_since = since
            self.pair.robot_heard(None)
        if self.pair.event is not None and since >= self.pair.event.started:
            self.pair.robot_begins(action, since)

    def robot_gesture_ends(self, action: Action, at: Seconds) -> None:
        if self.robot_backchannel.state == BRIEF and action != "point":
            self.robot_backchannel.ends(at)
        self._ends(action, at, by_robot=True)

    def turn_ends(self, at: Seconds) -> None:
        # Before the pair is decided: of several answers during the turn the one that began first counts.
        if self.robot_speaks_since is None:
            self._keep_floor(at)
        self.pair.turn_ends(at)
        self._floor_is_free(at)

    def _floor_is_free(self, at: Seconds) -> None:
        """Turn undecided speech that outlasts the other's turn into a turn of its own."""
        if not self.robot_holds_floor and (self._sign is None or not self._sign.is_beside):
            self._keep_floor(at)
            self._brief.clear()
        if self.robot_backchannel.state == UNDECIDED and not self.holds_floor:
            self._robot_takes_floor(at, "outlasts_turn")

    def _robot_takes_floor(self, at: Seconds, given: str = "limit") -> None:
        self.pair.robot_begins("speak", self.robot_backchannel.takes_floor(given, at))

    def turn_ended(self, turn: str, at: Seconds) -> None:
        if self.pair.is_turn(turn):
            self.turn_ends(at)

    def is_answered(self, at: Seconds, *, repairs: bool) -> None:
        """Take the robot's second turn, or a third one that repairs. Either answers a waiting person."""
        if repairs:
            self.pair.repaired(at)
        if self.robot_backchannel.state == UNDECIDED:
            self.robot_backchannel.takes_floor("outlasts_turn", at)
        self.pair.robot_begins("speak", at)
        self.pair.forget_unanswered()

    def abort(self, at: Seconds, *, turn: str) -> None:
        """End the pair of a robot's turn that was cut off.

        Who speaks into the turn at that moment has taken the floor, and so has answered, however long the speech was
        until then. Else the limit of a backchannel and the robot's own limit for giving way would be two judges.
        """
        if self.pair.is_turn(turn):
            self._keep_floor(at, "interruption")
            self.pair.abort(at)
            self._floor_is_free(at)

    def withdraw(self, event: OngoingEvent, at: Seconds, *, is_orphan: bool) -> None:
        """Withdraw a pair of the robot; see `Talk.withdraw`."""
        if self.pair.event is event and (self.pair.robot_holds_turn or not is_orphan):
            self.pair.abort(at)

    def block_ended(self, block: str, at: Seconds, *, aborted: bool) -> None:
        for pair, answer in self._cut_into:
            if answer == block:
                pair.answered_block_ended(at)
        self.pair.block_ended(block, at, aborted=aborted)
        announced = self.robot_backchannel.event
        if announced is not None and announced.block == block:
            self.robot_backchannel.ends(at)
        self._floor_is_free(at)

    def robot_announces(self, event: OngoingEvent, ended: Seconds | None) -> None:
        """Begin the robot's backchannel, unless it has been noticed. ended: when its block was over, if it was."""
        noticed = self.robot_backchannel.last
        if noticed is not None and abs(event.started - noticed[0]) <= self._config.backchannel_limit:
            self._writer.answer(event.request, noticed[1], event.started)
            event.request = ""
        else:
            self.robot_backchannel.announced(event)
        if ended is not None:
            self.robot_backchannel.ends(max(event.started, ended))

    def robot_asks(self, event: OngoingEvent) -> None:
        self._turned_at = event.started
        if self.robot_backchannel.state == UNDECIDED:
            self.robot_backchannel.takes_floor("outlasts_turn", event.started)
        if self.pair.robot_cuts_into_turn(event.started):
            self._cut_into = [each for each in self._cut_into if each[0].state != IDLE]
            self._cut_into.append((self.pair, event.block))
            self.pair = self._new_pair(self._writer, self._config)
        self.pair.robot_asks(event)
        if self.robot_speaks_since is not None:
            self.pair.robot_heard(None)

    def _pairs(self) -> Iterator[AdjacencyPair]:
        yield from (pair for pair, _ in self._cut_into)
        yield self.pair

    def _ends(self, action: Action, at: Seconds, *, by_robot: bool) -> None:
        """End an action for the sign that it is part of, and for all pairs: those cut into and the present one."""
        if not by_robot and self._sign is not None:
            for part in self._sign.going_on(action):
                part.until = at
            self._judge(at)
        for pair in self._pairs():
            pair.ends(action, at, by_robot=by_robot)

    def _backchannel(self, speaker: str, listener: str, at: Seconds, confidence: Probability = 1.0) -> OngoingEvent:
        cause: Cause = "human" if listener == self.id else "turn"
        return OngoingEvent(
            kind="backchannel", initiator=speaker, responder=listener, started=at, cause=cause, confidence=confidence
        )
