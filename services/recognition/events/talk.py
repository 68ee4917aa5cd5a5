"""Talk of one person and the robot, told to their `Dialogue` once it is known to whom each speech is.

In company it is known only at the end of a speech, or with its words, whether it is for the robot (`addressing`). And
where recognizers tell words, these tell whether a sound is speech at all: a cough after a question is no answer. What
the robot says or asks meanwhile may be the answer to it. So from such a speech on everything waits in line, and is
told in the order in which it happened, with its own times: what is known late has happened early.

Into the robot's words it is no other, only that the robot waits: it falls silent for what may be for it (`open`), so
that nothing is waited for longer than it has to be. To whom a sign of a listener is, and its words, are known here;
what it is says the conversation, which knows what else it may be (`listener_sign`).

The person's latest speeches are remembered (`own_speeches`). Of what nothing has been told, words that come late may
say anything: to whom it was, and that it was no noise. Of the rest they correct what the conversation has taken it
for (`listener`).
"""

from collections import deque
from collections.abc import Callable
from itertools import islice
from math import inf, nextafter
from typing import NamedTuple

from engage_hri.schemas.behaviors import EVENT_KINDS, Action, Event
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.addressing import NOBODY, WORDS_AFTER, Addressees, OwnSpeech
from engage_hri.services.recognition.events.conversation import Dialogue
from engage_hri.services.recognition.events.kinds import KindRecognizer
from engage_hri.services.recognition.events.limits import ROUNDING, LimitClock, in_time
from engage_hri.services.recognition.events.listener_sign import WORDS_WAIT, SignPart
from engage_hri.services.recognition.events.machine import Answered, EventWriter, OngoingEvent
from engage_hri.services.recognition.events.own_speeches import OwnSpeeches
from engage_hri.services.recognition.events.scene import Question, SessionScene
from engage_hri.services.text.listening import is_listening, says_words

Step = Callable[[Dialogue], object]


class QuestionEnd(NamedTuple):
    """End of a question of the robot, unless somebody has answered it before. is_cut_off: its turn is cut off."""

    step: Step
    is_cut_off: bool = False


class Talk(KindRecognizer):
    """Talk of one person with the robot: adjacency pairs, and the backchannels of both."""

    def __init__(self, id: str, scene: SessionScene, config: RecognitionConfig, writer: EventWriter) -> None:
        super().__init__(id, scene, config, writer)
        self._conversation = Dialogue(id, scene, config, writer)
        self._line: deque[tuple[Seconds, Step | OwnSpeech | QuestionEnd]] = deque()
        """What is not told yet, with its times. The first is a speech of which it is not known to whom it is."""
        self._asked_in_line: Seconds = inf
        """Start of the first turn of the robot that is in line; infinite: none is."""
        self._asked_in_turn = ""
        """The last turn in which the robot has asked the person."""
        self.speeches = OwnSpeeches(id, scene, config, writer)

    @property
    def question(self) -> Question | None:
        """The robot's question that waits for the person's answer, as far as is known; None: none does."""
        question = self._conversation.exchange.pair.question
        return question._replace(known_until=self._line[0][0]) if question is not None and self._line else question

    @property
    def undecided_since(self) -> Seconds | None:
        """Start of the first of what the person says of which it is not known whether it is for the robot."""
        beside = self._conversation.listener.beside_since
        return self._line[0][0] if beside is None and self._line else beside

    @property
    def asked_since(self) -> Seconds:
        """Time since when the robot asks the person, or waits for the answer, as far as is known; else infinite."""
        pair = self._conversation.exchange.pair
        return pair.event.started if pair.event is not None and pair.may_be_answered else self._asked_in_line

    def may_answer_before(self, answered: Answered) -> bool:
        """True if the person has answered the same turn of the robot, too, or may have, and has begun before."""
        pair, sign = self._conversation.exchange.pair, self._conversation.listener.sign
        is_asked = pair.is_turn(answered.event.turn)
        since = [at for at, _ in islice(self._line, 1)]
        if is_asked:
            since.append(pair.interrupted_since)
        if sign is not None and (sign.is_beside or is_asked):
            since.append(sign.since)
        return (min(since, default=inf), not is_asked, self.id) < answered.place

    @property
    def is_under_way(self) -> bool:
        """True if either speaks to the other, or something of the talk is open."""
        return bool(self._line) or self._conversation.is_under_way

    # -- time ---------------------------------------------------------------------------------------------------

    def outlook(self) -> tuple[Seconds, bool]:
        """See `KindRecognizer`. Contact is what the person says that is known to be for the robot."""
        in_contact = self.speeches.going_on is not None and self.speeches.going_on.is_to(self._scene.robot)
        if not self._line:
            return self._conversation.deadline, in_contact
        first, waits = self._undecided_first(), self._conversation.listener.waits_until
        if first is not None:
            return min(self._decided_at(first), waits), in_contact
        # What has waited for this very instant to be over may go on since, and nothing else may come that says so.
        return waits if self._is_behind_others() else min(waits, self._writer.now), in_contact

    def pass_time(self, at: Seconds) -> None:
        if self._line:
            self.go_on(at)
        else:
            self._conversation.pass_time(at)

    def _decided_at(self, speech: OwnSpeech) -> Seconds:
        """Time at which the first speech in line is decided."""
        scene, listener, since, until = self._scene, self._conversation.listener, speech.since, speech.until
        if speech.to is not None and speech.sound == "speech":
            return since + ROUNDING  # who has been asked, and begins in this very instant, comes first
        is_known = says_words(speech.words) or (self.id, since) in scene.echoes
        is_sign = self._conversation.is_into_turn(since)  # it holds the robot, which waits for no more than it has to
        if until is None:
            at_last = since + scene.longest_unknown
            if not is_sign:
                return at_last
            early = since if is_known and not is_listening(speech.words) else since + listener.longest
            is_for_robot = since if speech.is_to(scene.robot) else speech.faces.most_from(scene.robot, since)
            return min(at_last, max(early, is_for_robot))
        if is_known or not (scene.is_worded or scene.tells_addressees):
            return max(until, speech.worded_at)
        is_seen = speech.faces.most(since) == scene.robot and not scene.tells_addressees
        is_seen = is_sign and (is_seen or speech.is_to(scene.robot))
        over = until + (0.0 if is_seen else WORDS_AFTER)
        over = max(over, since + WORDS_WAIT) if is_sign or speech.is_beside else over
        return over + ROUNDING  # words that come in this very instant count

    # -- the person ---------------------------------------------------------------------------------------------

    def looks_at(self, face: str, at: Seconds) -> None:
        """Take a look at a face, or away from all ("")."""
        self.speeches.looks.append((at, face))
        if (speech := self.speeches.going_on) is not None:
            speech.faces.turns(face, at)
            self.speeches.may_interrupt(speech, face, at)
        self.go_on(at)

    def begins(self, began: ActionBegan, at: Seconds, face: str) -> None:
        action, confidence = began.action, began.confidence
        match action:
            case "speak":
                self._speaks(at, confidence, face)
            case "nod" | "shake" | "point":
                self._shows(at, face, lambda talk: talk.gestures(action, at, confidence))
            case "act":
                self._shows(at, face, lambda talk: talk.manipulates(at, confidence))

    def stops(self, action: Action, at: Seconds) -> None:
        if action == "speak":
            self._falls_silent(at)
        else:
            self.take(at, lambda talk: talk.action_ends(action, at))

    def _speaks(self, at: Seconds, confidence: Probability, face: str) -> None:
        """Take the beginning of a speech. face: whose face the person looks at."""
        if self.speeches.going_on is not None:
            self._falls_silent(at)  # it was begun by another id, of which no end has come
        speech = self.speeches.begin(at, confidence, face)
        speech.told = self._scene.told_to(self.id, at)
        speech.words = speech.part.words = self._writer.text_of(self.id, at)
        # What waits in line may be the robot's own turn, so that only the scene knows that it has begun.
        said, turn = self._scene.robot_spoken, self._scene.turn
        is_to_person = said.is_to(self.id) if said is not None and said.since <= at else None
        speech.is_beside = is_to_person is False
        may_be_in_turn = bool(is_to_person) or (turn is not None and turn[0] == self._asked_in_turn)
        is_unsure = self._scene.is_worded and not says_words(speech.words)
        speech.sound = "unsure" if is_unsure and self._scene.lines.get(self.id) != at else "speech"
        speech.is_into_turn = may_be_in_turn if self._line else self._conversation.is_into_turn(at)
        self.speeches.is_certain(speech, at)
        self.speeches.may_interrupt(speech, face, at)
        self._queue(at, speech)

    def _falls_silent(self, at: Seconds) -> None:
        """Take the end of the speech that goes on."""
        speech, self.speeches.going_on = self.speeches.going_on, None
        if speech is None:
            return
        speech.until = at
        speech.faces.turns("", at)
        self.take(at, self._end_of(speech, at))
        self.go_on(at)

    def _end_of(self, speech: OwnSpeech, at: Seconds) -> Step:
        """Step that tells the end of a speech, if that is for the robot."""
        return lambda talk: talk.falls_silent(at) if speech.is_to(self._scene.robot) else None

    def _shows(self, at: Seconds, face: str, step: Step) -> None:
        """Take a sign without words, which is to the robot unless the person looks at somebody else's face.

        Of who looks at nobody's it is to the robot if that has just spoken to the person.
        """
        if not self._scene.company(self.id) or face == self._scene.robot:
            self._take_in_order(at, step)
        elif not face:  # what is in line may be the robot's words
            self._take_in_order(at, lambda talk: step(talk) if talk.is_spoken_to else None)

    def goes_on(self, action: Action, since: Seconds, at: Seconds, confidence: Probability, face: str) -> None:
        """Take an action that goes on, known only now, at `at`. It has been decided by the looks of now to whom."""
        part = SignPart(action, since, confidence)
        if action == "speak" and self.speeches.has_said(since):
            known = self.speeches.going_on  # it has been told by another id of the person
            if known is None or not known.is_heard:
                return
            part = known.part
        elif action == "speak":
            speech = self.speeches.begin(since, confidence, face)
            if not self.speeches.is_certain(speech, at):
                self.speeches.address(speech, self._likely(speech, at), at)
            if not speech.is_to(self._scene.robot):
                return
            speech.is_heard, part = True, speech.part
        self.take(at, lambda talk: talk.goes_on(part))

    def understand(self, since: Seconds, words: str, told: Addressees | None, at: Seconds) -> None:
        """Take the words of a speech. told: addressees, if perception knows them."""
        speech = self.speeches.find(since)
        if speech is None:
            self._writer.interject_again(self.id, since, at)
            return
        self.speeches.hear(speech, words, told, at)
        if not speech.is_heard or speech.sound == "noise":
            self._has_news(speech, at)
        known, over = speech.words, (at if speech.until is None else speech.until) + WORDS_AFTER
        is_in_time = at <= max(since + WORDS_WAIT, over if speech.is_beside else since) + ROUNDING
        # What the line holds may have ended the robot's turn, so that only the speech knows that it is not into that.
        is_late = (speech.is_into_turn or speech.is_beside) and self._may_be_for_robot(speech) and not is_in_time
        if speech.sound == "unsure" and says_words(known) and not is_late:
            self._scene.decide(speech, at)
        # What has been waited for was known when the speech began. The line waits for no words of who is alone.
        if is_in_time and speech.company and any(each is speech for _, each in self._line):
            speech.part.words = known
        elif is_in_time and self._conversation.listener.listens_to(speech.part):
            self.take_early(since, lambda talk: self._judge(talk, speech, known, at))
        else:
            self._take_in_order(at, lambda talk: self._judge(talk, speech, known, at))
        self.go_on(at)

    def _judge(self, talk: Dialogue, speech: OwnSpeech, words: str, at: Seconds) -> None:
        """Take the words of a speech in their turn; if they decide nothing they are told all the same.

        Of what nothing has been told they make speech, unless either has spoken since: all before has been told.
        """
        speech.part.words = words or speech.part.words
        talk.understand(speech.part, at)
        self._writer.interject_again(self.id, speech.since, at)
        is_late = speech.sound == "noise" and says_words(speech.words)
        is_new = is_late if speech.is_heard else speech.is_to(self._scene.robot)
        if is_new and self._scene.is_last(self.id, speech.since, at):
            if not speech.is_heard:  # else it is beside a gesture that was told
                talk.exchange.take(speech.part)
            speech.is_heard = True
            self._scene.decide(speech, at)

    def _has_news(self, speech: OwnSpeech, at: Seconds) -> None:
        """Take news of a speech of which nothing is told yet: it may be for others than it seemed, and no noise."""
        is_noise = speech.sound == "noise"
        if is_noise and not says_words(speech.words):
            return
        if not self.speeches.is_certain(speech, at) and is_noise and not speech.is_heard:
            self.speeches.address(speech, self._likely(speech, at), at)
        if not speech.is_to(self._scene.robot):
            speech.is_heard, speech.part.taken_for = False, ""  # more of the words may still call it
            if is_noise:
                self._scene.decide(speech, at)
        elif not speech.is_heard and not any(each is speech for _, each in self._line):
            speech.part.until = speech.until
            speech.is_heard = speech.until is None or speech.is_into_turn or speech.is_beside
            if speech.until is None:
                self.take_early(speech.since, lambda talk: talk.speaks(speech.part, beside=speech.is_beside))
            elif speech.is_heard:
                self._scene.decide(speech, at, is_noise=True)
                speech.part.taken_for = "noise"  # as such it is judged by its words

    def person_gone(self, at: Seconds, until: Seconds) -> None:
        """Take the person's leaving: nothing waits any longer. What others do in this instant comes before it."""
        if self.speeches.going_on is not None and self.speeches.going_on.until is None:
            self.speeches.going_on.until = until
        self.speeches.going_on = None
        for _, each in self._line:
            if isinstance(each, OwnSpeech) and not self._is_known(each):
                self._decide(each, at)
        self.go_on(at)
        self._take_in_order(nextafter(at, inf), lambda talk: self._is_gone(talk, at, until))

    def _is_gone(self, talk: Dialogue, at: Seconds, until: Seconds) -> None:
        talk.person_gone(at, until)
        self.speeches.forget()

    def take_over(self, other: "Talk", at: Seconds, *, goes_on: bool) -> None:
        """Take what the person has said by another id; what is not decided of it is decided here.

        goes_on: what they say by that id goes on. What both ids have said at one time, two reporters have told.
        """
        self.person_back()
        self._conversation.exchange.pair.take_over(other._conversation.exchange.pair, self.id, other.id)
        for speech in other.speeches.in_order():
            is_open = other._is_undecided(speech.since)
            speech.actor = self.id
            speech.until = at if speech.until is None and not goes_on else speech.until
            if self.speeches.has_said(speech.since, speech.until, speech):
                self._scene.forget_spoken(speech)
                own = self.speeches.find(speech.since)
                is_aside = own is not None and bool(own.named) and not own.is_to(self._scene.robot)
                if is_open and (is_aside or not self._is_undecided(speech.since)):
                    self._writer.decide_interjection(self.id, speech.since, "other" if is_aside else "noise", at)
                continue
            self.speeches.remember(speech)
            if is_open:
                self._begin_again(speech)
        self.go_on(at)

    def _is_undecided(self, since: Seconds) -> bool:
        """True if it is not decided yet what the person has begun to say at `since`."""
        sign = self._conversation.listener.sign
        in_line = any(isinstance(each, OwnSpeech) and each.since == since for _, each in self._line)
        return in_line or (sign is not None and any(each.since == since for each in sign.speeches))

    def _begin_again(self, speech: OwnSpeech) -> None:
        """Put a speech in line, in its place."""
        since, until, speech.is_heard, speech.is_decided = speech.since, speech.until, False, False
        speech.part = SignPart("speak", since, speech.part.confidence, words=speech.words)
        self._line.insert(self._place(since), (since, speech))
        if until is not None:  # it is over before the next begins, be it in this very instant
            place = self._place(max(since, nextafter(until, -inf)))
            self._line.insert(place, (until, self._end_of(speech, until)))

    def person_back(self) -> None:
        """Take the person's return: the robot may be speaking, or may have fallen silent meanwhile."""
        self._conversation.robot_speaks_since = self._scene.robot_speaks_to(self.id)

    # -- the line -----------------------------------------------------------------------------------------------

    def take(self, at: Seconds, step: Step) -> None:
        """Take what happens at `at` to the conversation: now, or in its turn."""
        if self._line:
            self._line.append((at, step))
        else:
            step(self._conversation)

    def take_early(self, at: Seconds, step: Step) -> None:
        """Take what happened at `at` and is known only now: it comes before all in line that happened later."""
        if place := self._place(at):
            self._line.insert(place, (at, step))
        else:
            self._catch_up(at)
            step(self._conversation)

    def _place(self, at: Seconds) -> int:
        """Number of those in line that come before what happened at `at`."""
        return next((n for n, (when, _) in enumerate(self._line) if when > at), len(self._line))

    def limit(self, wanted: Event) -> Seconds | None:
        longest = self._config.manipulation_limit if "act" in wanted.accept else self._config.adjacency_pair_limit
        return longest if EVENT_KINDS[wanted.kind].is_answered else None

    def robot_asks(self, event: OngoingEvent, clock: LimitClock | None, ended: Seconds | None) -> None:
        """Take the robot's first turn, or the announcement of its backchannel."""
        at = event.started
        if event.kind == "backchannel":
            # The person holds the floor: it is the initiator.
            event.initiator, event.responder = self.id, self._scene.robot
            self._scene.listening_blocks[event.block] = None
            self.take(at, lambda talk: talk.robot_announces(event, ended))
            return
        self._asked_in_turn = event.turn
        self._take_in_order(at, lambda talk: talk.robot_asks(event))
        if self._line:
            self._asked_in_line = min(at, self._asked_in_line)
        if ended is not None:
            self.take(at, lambda talk: talk.turn_ends(max(ended, at)))

    def robot_begins(self, began: ActionBegan, at: Seconds) -> None:
        if began.action == "speak" and not self._scene.is_listening(began.behavior):
            self.take(at, lambda talk: talk.exchange.pair.robot_says(at))

    def robot_stops(self, action: Action, at: Seconds) -> None:
        if self.is_under_way and action == "speak":
            self.take(at, lambda talk: talk.robot_falls_silent(at))
        elif self.is_under_way and action in ("nod", "shake", "point"):
            self.take(at, lambda talk: talk.robot_gesture_ends(action, at))

    def withdraw(self, event: OngoingEvent, at: Seconds, *, is_orphan: bool) -> None:
        """Withdraw a pair of the robot.

        What the robot has said until the end of its turn is answered all the same: a pair without anybody who asked
        for it stays.
        """
        self.take(at, lambda talk: talk.withdraw(event, at, is_orphan=is_orphan))

    def abort(self, at: Seconds, *, turn: str) -> None:
        # Who has interrupted the turn has done so before that, also if it is known only now, and told of `at`.
        self._take_in_order(nextafter(at, inf), lambda talk: talk.abort(at, turn=turn), is_cut_off=True)

    def block_ended(self, block: str, at: Seconds, *, aborted: bool) -> None:
        self.take(at, lambda talk: talk.block_ended(block, at, aborted=aborted))

    def _take_in_order(self, at: Seconds, step: Step, *, is_cut_off: bool = False) -> None:
        """Take what ends a question of the robot, after what somebody else may have answered before."""
        waits = self._scene.is_contested(self.id, at) if is_cut_off else self._waits_for_others(at)
        if self._line or (self.asked_since < inf and waits):
            self._line.append((at, QuestionEnd(step, is_cut_off)))
        else:
            step(self._conversation)

    def _waits_for_others(self, at: Seconds) -> bool:
        """True if somebody else may have answered the robot before `at`. In its turn each who interrupts answers."""
        return not self._conversation.is_into_turn(at) and self._scene.is_contested(self.id, at)

    def _is_behind_others(self) -> bool:
        """True if the first in line waits until it is known whether somebody else has answered before."""
        since, (at, first) = self.undecided_since, self._line[0]
        for each in self._writer.answered:
            if each.place[0] <= at and not self.may_answer_before(each):
                return True  # it is to be told first that this has answered for all
        if since is None or (isinstance(first, QuestionEnd) and first.is_cut_off):
            return since is not None and self._scene.is_contested(self.id, since)
        # Else it says nothing, and ends no question.
        may_matter = isinstance(first, OwnSpeech) or (
            isinstance(first, QuestionEnd) and self._conversation.exchange.pair.may_be_answered
        )
        return may_matter and self._waits_for_others(since)

    def _undecided_first(self) -> OwnSpeech | None:
        """The first in line, if it is a speech that is not decided; None: it is to be told next."""
        first = self._line[0][1]
        return first if isinstance(first, OwnSpeech) and not self._is_known(first) else None

    def _is_into_words(self, speech: OwnSpeech) -> bool:
        """True of what is for the robot, as far as is known, and into its words: the conversation says what it is."""
        is_into_words = speech.is_beside or self._conversation.is_into_turn(speech.since)
        return is_into_words and self._may_be_for_robot(speech)

    def _may_be_for_robot(self, speech: OwnSpeech) -> bool:
        """True of what is for the robot, as far as is known."""
        robot = self._scene.robot
        return speech.faces.most(speech.since) in ("", robot) if speech.to is None else speech.is_to(robot)

    def _is_known(self, speech: OwnSpeech) -> bool:
        """True if it is known to whom a speech in line is, that it is no cough, and who else speaks in that instant.

        Of who is alone with it the conversation judges, if it is into the robot's words.
        """
        may_be_noise = speech.sound == "unsure" and (speech.company or not self._is_into_words(speech))
        may_be_second = self._writer.now <= speech.since and bool(self._scene.questions.keys() - {self.id})
        return speech.is_decided or (speech.to is not None and not may_be_noise and not may_be_second)

    def _queue(self, at: Seconds, speech: OwnSpeech) -> None:
        is_contested = speech.is_to(self._scene.robot) and self._waits_for_others(at)
        if self._line or is_contested or not self._is_known(speech):
            self._line.append((at, speech))
        else:
            self._tell(speech)

    def _tell(self, speech: OwnSpeech) -> None:
        """Tell the conversation of a speech, if it is for the robot."""
        if speech.is_to(self._scene.robot):
            speech.is_heard = True
            self._conversation.speaks(speech.part, beside=speech.is_beside)
            if speech.sound == "unsure" and not self._conversation.listener.listens_to(speech.part):
                self._scene.decide(speech, self._writer.now)

    def _decide(self, speech: OwnSpeech, at: Seconds) -> None:
        """Decide what the sound is, by what was known when it was due: nothing, or to whom it is."""
        at = min(at, self._decided_at(speech))  # it may have waited in line since
        to = self._likely(speech, at) if speech.to is None else speech.to
        is_judged_here = not self._is_into_words(speech) or self._scene.robot not in to
        is_noise = is_judged_here and speech.sound == "unsure" and speech.until is not None
        speech.is_decided = True
        if is_judged_here and speech.sound == "unsure":
            self._scene.decide(speech, at, is_noise=is_noise)
        if is_noise:
            speech.to = NOBODY
            self._writer.decide_interjection(self.id, speech.since, "noise", at)
        elif speech.to is None:
            self.speeches.address(speech, to, at)

    def _likely(self, speech: OwnSpeech, at: Seconds) -> Addressees:
        """Addressees of a speech by what is likely."""
        pair = self._conversation.exchange.pair
        waits = pair.may_be_answered_with("speak") and in_time(speech.since, pair.deadline)
        return self.speeches.likely(speech, at, frozenset((self._scene.robot,)) if waits else NOBODY)

    def may_go_on(self, now: Seconds) -> bool:
        """True if it is decided before `now` to whom the first speech in line is, or if what is known may be told.

        What is due in this very instant waits for all that happens in it: who is silent then has not gone on.
        """
        if not self._line or self._conversation.deadline < self._line[0][0] - ROUNDING:
            return bool(self._line)
        speech = self._undecided_first()
        return not self._is_behind_others() if speech is None else self._decided_at(speech) < now - ROUNDING

    def go_on(self, now: Seconds) -> None:
        """Tell all in line up to the next speech of which it is not known to whom it is."""
        while self._line:
            if (waits := self._conversation.listener.waits_until) <= now:
                self._conversation.pass_time(waits)
            at, item = self._line[0]
            self._catch_up(at)
            if (speech := self._undecided_first()) is not None:
                if self._decided_at(speech) > now:
                    break
                self._decide(speech, now)
                continue
            if self._is_behind_others():
                break
            self._line.popleft()
            if isinstance(item, OwnSpeech):
                self._tell(item)
            else:
                (item.step if isinstance(item, QuestionEnd) else item)(self._conversation)
        if not self._line:
            self._asked_in_line = inf

    def _catch_up(self, until: Seconds) -> None:
        """Take the steps of the conversation that were due before `until`."""
        last = until - ROUNDING
        while (due := self._conversation.deadline) < last:
            self._conversation.pass_time(due)
