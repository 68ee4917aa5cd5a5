"""A coder who sees a whole timeline, and writes down the events with the robot by their definitions.

Takes nothing from the code that it judges. Definitions: thesis 2.2; limits and what people mean by overlapping signs:
docs/recognition.md.
"""

from collections.abc import Iterator, Sequence
from itertools import groupby
from math import inf
from typing import Any

from msgspec import Struct
from msgspec.structs import astuple

from engage_hri.schemas.recognition import ConnectionEvent
from tests.recognition.observations import ROBOT
from tests.recognition.timeline import LIMIT, LISTENING, Absence, Instant, Span, Timeline, Turn

BRIEF = 0.8
"""Longest speech of a listener whose words nobody tells."""
WORDS_WAIT = 1.5
WORDS_AFTER = 1.0
LONGEST_SOUND = 3.0
"""Longest sound without words that may be none; where perception tells addressees, the words come late."""
LONGEST_SOUND_TOLD = 15.0
THIRD_TURN = 1.5
FACE_GRACE = 2.0
ROUND = 1e-6
BEFORE = (-100.0, 0)
LAST = 10**9
"""After all else that happens at a time."""


class Coded(Struct, frozen=True, order=True):
    """An event as both the coder and recognition have it. delay: None: none. late: of an answer after the limit."""

    kind: str
    initiator: str
    responder: str
    started: float
    state: str
    delay: float | None = None
    answered_by: str = ""
    late: float | None = None


class Side:
    """One person and the robot, as far as the coder has read."""

    def __init__(self, person: str) -> None:
        self.person = person
        self.own: list[Span] = []
        """The person's speeches that wait for the robot's answer: one turn."""
        self.asked: Turn | None = None
        """The robot's turn that waits for the person's answer."""
        self.unanswered: Turn | None = None
        """The robot's last turn, if nobody has answered it in time."""
        self.cut_into: Span | None = None
        """The person's words into which the robot has begun its answer."""
        self.third_until = BEFORE[0]
        self.answers_until = BEFORE
        """End of the person's last answer: what begins before it is part of it."""


class Coder:
    """Reads a timeline from beginning to end; of each sign it knows all that is still to come."""

    def __init__(self, timeline: Timeline, limit: float = LIMIT) -> None:
        self._timeline, self._limit = timeline, limit
        self._sides = {person: Side(person) for person in timeline.people}
        self._events: dict[tuple[str, str, str, float], Coded] = {}
        self._used: set[int] = set()
        """Signs that have been read within a turn of the robot, by `id`."""
        self._turns: set[int] = set()
        """Those that turned out to be turns of the person, to be read when they come."""
        self._late: list[Span] = []
        """Those that are known to be turns only when their words come, for which nobody has waited."""
        self._gone = [each for each in timeline.away if each.until[0] - each.since[0] >= FACE_GRACE]

    def events(self) -> list[Coded]:
        """Adjacency pairs and backchannels, each as it was decided."""
        signs = [each for each in self._timeline.spans if each.to == ROBOT and each.action != "look"]
        acts: list[Span | Turn | Absence] = [*signs, *self._timeline.turns, *self._gone]
        for act in self._in_order(acts):
            if isinstance(act, Turn):
                self._robot_speaks(act)
                for side in self._sides.values():
                    if side.person not in act.to:
                        self._listens_beside(side, act)
            elif isinstance(act, Absence):
                self._leaves(self._sides[act.who], act)
            elif id(act) in self._turns:
                self._takes_turn(self._sides[act.who], act)
            elif id(act) not in self._used:
                self._person(self._sides[act.who], act)
        for side in self._sides.values():
            self._expire(side, 1e6)
        return sorted(self._events.values())

    def _in_order(self, acts: list[Span | Turn | Absence]) -> Iterator[Span | Turn | Absence]:
        """All that happens, as it comes: of several at one time, who was asked is heard first, then by their ids."""
        for at, together in groupby(sorted(acts, key=_known), key=lambda act: _known(act)[0]):
            yield from self._late_words(at)
            for side in self._sides.values():
                self._expire(side, at)
            yield from sorted(together, key=self._place)
        yield from self._late_words(inf)

    def _late_words(self, until: float) -> Iterator[Span]:
        """Speeches of which nothing was told before their words, which come until then: what waits may be theirs."""
        while self._late and (first := min(self._late, key=_words_come)) and _words_come(first) <= until:
            self._late.remove(first)
            self._turns.add(id(first))
            for side in self._sides.values():
                self._expire(side, _words_come(first))
            yield first

    def _place(self, act: Span | Turn | Absence) -> tuple[bool, bool, str]:
        if len(self._sides) == 1 or not isinstance(act, Span):
            return isinstance(act, Absence), False, ""
        return False, self._sides[act.who].asked is None, self._timeline.id(act.who)

    def _note(self, kind: str, initiator: str, responder: str, at: float, state: str, **more: Any) -> None:
        self._events[kind, initiator, responder, at] = Coded(kind, initiator, responder, at, state, **more)

    def _pair_of(self, turn: Turn, side: Side, state: str, **more: Any) -> None:
        self._note("adjacency_pair", ROBOT, side.person, turn.since[0], state, **more)

    def _own_pair(self, side: Side, state: str, **more: Any) -> None:
        self._note("adjacency_pair", side.person, ROBOT, side.own[0].since[0], state, **more)
        side.own = []

    # -- what ends by itself --------------------------------------------------------------------------------------

    def _expire(self, side: Side, now: float) -> None:
        """Let the limits pass that are over before `now`."""
        if side.asked is not None and side.asked.until[0] + self._limit + ROUND < now:
            self._pair_of(side.asked, side, "failed")
            side.asked, side.unanswered = None, side.asked
        if side.own and side.own[-1].until[0] + self._limit + ROUND < now:
            self._own_pair(side, "failed")

    def _leaves(self, side: Side, absence: Absence) -> None:
        if side.asked is not None:
            self._pair_of(side.asked, side, "failed")
        if side.own:
            self._own_pair(side, "withdrawn")
        side.asked = side.unanswered = None

    # -- the robot ------------------------------------------------------------------------------------------------

    def _robot_speaks(self, turn: Turn) -> None:
        """Read a turn of the robot. Who answers into it first has answered for all who are silent."""
        answers = [(side, self._robot(side, turn)) for side in map(self._sides.__getitem__, turn.to)]
        given = [(answer.since, answer) for _, answer in answers if answer is not None]
        for side, answer in answers if given else ():
            if answer is None:
                self._is_answered(side, turn, "succeeded", min(given, key=lambda each: each[0])[1])

    def _is_answered(self, side: Side, turn: Turn, state: str, answer: Span) -> None:
        """Note that what a person was asked has been answered by another."""
        self._pair_of(turn, side, state, delay=answer.since[0] - turn.until[0], answered_by=answer.who)
        side.asked = side.unanswered = None

    def _robot(self, side: Side, turn: Turn) -> Span | None:
        """Read a turn of the robot: it answers who waits, or still speaks; and what is said and shown into it.

        Returns the answer into a turn that asks; None: there is none.
        """
        was_waiting = bool(side.own)
        was_over = was_waiting and side.own[-1].until < turn.since
        if was_waiting:
            side.cut_into = None if was_over else side.own[-1]
            self._own_pair(side, "succeeded", delay=turn.since[0] - side.own[-1].until[0])
            # An answer that asks is over, as an answer, when the question begins.
            end = turn.until if turn.kind == "replies" else turn.since if was_over else BEFORE
            side.third_until = end[0] + THIRD_TURN
        elif side.cut_into is not None and turn.since < side.cut_into.until:
            if turn.kind == "replies":  # it goes on with its answer
                side.third_until = turn.until[0] + THIRD_TURN
        elif turn.kind == "replies" and self._is_listening(side, turn):
            self._note("backchannel", side.person, ROBOT, turn.since[0], "completed")
        if turn.kind == "asks" and side.asked is not None:
            self._pair_of(side.asked, side, "superseded")
            side.asked = None
        side.unanswered = None
        answers = self._listens(side, turn)
        answer = answers[0] if answers else None
        if turn.kind != "asks":
            # What interrupts an answer is of the same exchange; what goes on after it is the third turn.
            kept = [each for each in answers if not (was_waiting and self._is_decided(each, turn))]
            self._turns |= {id(each) for each in kept}
        elif answer is not None:
            self._pair_of(turn, side, "succeeded", delay=answer.since[0] - turn.until[0])
            side.answers_until, side.third_until = answer.until, BEFORE[0]
            return answer
        elif turn.is_aborted:
            self._pair_of(turn, side, "withdrawn")
        else:
            side.asked = turn
        return None

    def _listens(self, side: Side, turn: Turn) -> list[Span]:
        """Read what a person does in the robot's turn. Returns what takes the floor."""
        signs = [
            each for each in self._timeline.spans
            if each.who == side.person and each.to == ROBOT and each.action != "look"
            and turn.since < each.since < turn.until
        ]  # fmt: skip
        self._used |= {id(each) for each in signs}
        if turn.is_aborted:
            signs = self._without_late(signs, turn)
        every, signs = signs, [each for each in signs if not self._goes_with_words(each, turn)]
        found: list[Span] = []
        too_late: list[Span] = []
        sets = [*self._together(signs)]
        may_be_answered = turn.kind == "asks" or side.asked is not None
        for number, sign in enumerate(sets):
            answers_too = may_be_answered and not found  # a gesture answers nothing that is answered
            goes_on = [each for each in sign if each.until > turn.until and (each.action == "speak" or answers_too)]
            following = sets[number + 1][0].since if number + 1 < len(sets) else (1e9, 0)
            over = max(each.until for each in every if sign[0].since <= each.since <= sign[-1].until)
            late = [each for each in sign if self._is_told_late(each, following, over)]
            is_brief = any(over < each.known for each in late if each.known is not None) and not goes_on
            parts = [each for each in sign if each not in late and self._shows(each)]
            corrected = [each for each in late if each.known is not None and each.known < turn.until]
            interrupts = [
                each for each in sign
                if each.action == "speak" and self._interrupts(each, turn) and (each not in late or each in corrected)
            ]  # fmt: skip
            answers = sorted([*goes_on, *interrupts], key=lambda each: each.since)
            too_late += [
                each for each in late
                if not parts and not answers and each not in corrected
                and each.words not in LISTENING and self._is_last(each)
            ]  # fmt: skip
            if answers:
                found.append(answers[0])
                is_listening = is_brief
            else:
                is_listening = not (found and any(each.seconds > WORDS_WAIT + ROUND for each in sign))
            if is_listening and parts:
                self._note("backchannel", ROBOT, side.person, parts[0].since[0], "completed")
                continue  # one sign gives one, also if words of it come later
            for each in late if not answers else ():
                if each.words in LISTENING and (each in corrected or self._is_last(each)):
                    self._note("backchannel", ROBOT, side.person, each.since[0], "completed")
        if not (turn.kind == "asks" and found):  # else they are of the answer into the turn
            self._late += too_late
        return found

    def _listens_beside(self, side: Side, turn: Turn) -> None:
        """Read what somebody says to the robot while it says something to another."""
        for since, until in turn.speech:
            beside = [
                each for each in self._timeline.spans
                if each.who == side.person and each.to == ROBOT and each.action == "speak"
                and since < each.since < until
            ]  # fmt: skip
            for speech in beside:
                sign = [
                    each for each in self._timeline.spans
                    if each.who == side.person and speech.since < each.since < speech.until
                    and each.action not in ("speak", "look")
                ]  # fmt: skip
                self._used |= {id(speech), *map(id, sign)}
                sign = [each for each in sign if self._is_shown_to_robot(side, each)]
                heard = max(speech.since[0] + WORDS_WAIT, speech.until[0] + WORDS_AFTER)
                is_in_time = speech.known is not None and speech.known[0] <= heard + ROUND
                is_known = is_in_time or (self._is_last(speech) and not any(map(self._shows, sign)))
                is_noise = self._timeline.is_worded and not is_known
                shown = sorted(each.since for each in sign if self._shows(each))
                shown = shown if is_noise else [speech.since]
                longest = longest_sound(self._timeline) if self._timeline.is_worded else BRIEF
                is_brief = speech.seconds <= longest + ROUND
                takes_floor = speech.words not in LISTENING if is_known else not is_brief
                if speech.until <= until and takes_floor and is_known and not is_in_time:
                    self._late.append(speech)
                elif speech.until > until or takes_floor:
                    self._turns.add(id(speech))
                elif shown:
                    self._note("backchannel", ROBOT, side.person, shown[0][0], "completed")

    def _is_shown_to_robot(self, side: Side, sign: Span) -> bool:
        """True if a gesture is for the robot: of who was not asked it is only if the head says so."""
        looks = [each for each in self._timeline.spans if each.who == sign.who and each.action == "look"]
        is_seen = any(each.since < sign.since < each.until and each.to == ROBOT for each in looks)
        is_asked = side.asked is not None and sign.since[0] <= side.asked.until[0] + self._limit + ROUND
        return is_seen or is_asked or len(self._sides) == 1

    def _is_last(self, speech: Span) -> bool:
        """True if words come of a speech, and neither the person nor the robot to them has spoken before they do."""
        return speech.known is not None and not has_spoken_since(speech, self._timeline)

    def _is_listening(self, side: Side, turn: Turn) -> bool:
        """True if the robot says a little while the person speaks, and has nothing to answer."""
        speech = [each for each in self._timeline.spans if _speaks_to_robot(each, side.person)]
        beside = any(
            each.since < turn.since and turn.until < each.until and not self._is_noise(each) for each in speech
        )
        return beside and turn.until[0] - turn.since[0] <= BRIEF + ROUND

    def _without_late(self, signs: list[Span], turn: Turn) -> list[Span]:
        """Leave out what is said before a turn is cut off, and known to be no listener's only later: it is a turn.

        A gesture beside it that goes on has answered already.
        """
        for one in signs:
            if self._comes_after_cut(one, turn) and self._is_heard(one) and one.words not in LISTENING:
                beside = [each for each in signs if one.since <= each.since < one.until]
                goes_on = [each for each in beside if each.until > turn.until]
                self._turns |= set() if goes_on else {id(one)}
                signs = [each for each in signs if each in goes_on or each not in beside]
        return signs

    def _comes_after_cut(self, speech: Span, turn: Turn) -> bool:
        """True if words of who is alone come after a turn is cut off: in company the cut waits in line for them."""
        is_over = turn.is_aborted and speech.known is not None and speech.until < turn.until <= speech.known
        return is_over and not company(speech, self._timeline)

    def _shows(self, sign: Span) -> bool:
        """True for what shows that somebody listens: a nod, or words; any sound only where no words are told."""
        is_noise = sign.action == "speak" and self._timeline.is_worded and sign.known is None
        return sign.action != "point" and not is_noise

    def _is_told_late(self, speech: Span, following: Instant, over: Instant = BEFORE) -> bool:
        """True if a sound has been told as noise when its words come.

        following: when the next sign begins. over: when the sign is over, of which it is part, and told.
        """
        if speech.known is None or speech.seconds > WORDS_WAIT + ROUND:
            return False
        # In company each next sign waits in line until the words of the one before have come.
        is_next = not company(speech, self._timeline) and following < speech.known
        return is_next or speech.known[0] > max(speech.since[0] + WORDS_WAIT, over[0]) + ROUND

    def _goes_with_words(self, sign: Span, turn: Turn) -> bool:
        """True for a gesture beside the person's own words, if these are no listener's: it says nothing more."""
        beside = self._words_beside(sign)
        own = [
            each
            for each in beside
            if each.since < turn.since
            or (
                self._interrupts(each, turn)
                and not (
                    self._is_told_late(each, _following(each, self._timeline)) or self._comes_after_cut(each, turn)
                )
            )
        ]
        return sign.action != "speak" and bool(own)

    def _words_beside(self, sign: Span) -> list[Span]:
        """What the person says to the robot when the sign begins."""
        return [
            each for each in self._timeline.spans
            if each.who == sign.who and each.action == "speak" and each.to == ROBOT
            and each.since < sign.since < each.until and not self._is_noise(each)
        ]  # fmt: skip

    def _together(self, signs: Sequence[Span]) -> Iterator[list[Span]]:
        """What is done at the same time is one sign."""
        found: list[Span] = []
        for each in sorted(signs, key=lambda each: each.since):
            if found and max(one.until for one in found) < each.since:
                yield found
                found = []
            found.append(each)
        if found:
            yield found

    def _is_decided(self, answer: Span, turn: Turn) -> bool:
        """True if it is known before the end of the robot's words that somebody has interrupted them.

        In company also with words that come later: it has waited for them, and what is known late has happened early.
        """
        decided = min(answer.until[0], answer.since[0] + (WORDS_WAIT if self._timeline.is_worded else BRIEF))
        is_told_late = (
            bool(company(answer, self._timeline)) and self._is_heard(answer) and answer.words not in LISTENING
        )
        return answer.action == "speak" and (decided < turn.until[0] - ROUND or is_told_late)

    def _interrupts(self, speech: Span, turn: Turn) -> bool:
        """True if a speech that is over within the robot's turn takes the floor, as far as is known in time."""
        if speech.is_line:
            return speech.words not in LISTENING
        is_open = turn.kind == "asks" or speech.seconds <= WORDS_WAIT + ROUND
        if is_open and self._is_known_in(speech, turn):
            return speech.words not in LISTENING
        return speech.seconds > (WORDS_WAIT if self._timeline.is_worded else BRIEF) + ROUND

    def _is_known_in(self, speech: Span, turn: Turn) -> bool:
        """True if the words of a speech are known while they are waited for, or the turn goes on."""
        return speech.known is not None and (self._is_heard(speech) or speech.known < turn.until)

    def _is_heard(self, speech: Span) -> bool:
        """True if the words of a speech are known while they are waited for."""
        return speech.known is not None and speech.known[0] <= speech.since[0] + WORDS_WAIT + ROUND

    # -- the person -----------------------------------------------------------------------------------------------

    def _person(self, side: Side, sign: Span) -> None:
        """Read a sign outside the robot's turns to this person."""
        is_gesture = sign.action != "speak"
        goes_with_words = is_gesture and (self._words_beside(sign) or not self._is_shown_to_robot(side, sign))
        if sign.since >= side.answers_until and not goes_with_words and not self._is_noise(sign):
            if self._timeline.is_worded and _is_late(sign) and sign.seconds <= longest_sound(self._timeline) + ROUND:
                self._late.append(sign)
            else:
                self._takes_turn(side, sign)

    def _is_noise(self, sign: Span) -> bool:
        """True for a cough, or a laugh: no words come where they would have come, or too late to say anything."""
        is_unheard = sign.known is None or (_is_late(sign) and not self._is_last(sign))
        is_wordless = is_unheard and self._timeline.is_worded and id(sign) not in self._used
        return sign.action == "speak" and is_wordless and sign.seconds <= longest_sound(self._timeline) + ROUND

    def _takes_turn(self, side: Side, sign: Span) -> None:
        """Read an answer, or words of the person's own."""
        at = sign.since[0]
        if side.unanswered is not None and self._has_spoken(side.unanswered, sign):
            side.unanswered = None
        if side.asked is not None:
            turn = side.asked
            self._pair_of(turn, side, "succeeded", delay=at - turn.until[0])
            for other in self._sides.values():
                if other is not side and other.asked is turn and not self._begins_too(other, sign):
                    self._is_answered(other, turn, "succeeded", sign)
            side.asked, side.answers_until, side.third_until = None, sign.until, BEFORE[0]
        elif sign.action == "speak" and (asked := self._asked_of_another(side, sign)) is not None:
            for other in self._sides.values():
                if other.asked is asked:
                    self._is_answered(other, asked, "preempted", sign)
            side.unanswered = None
        elif side.unanswered is not None:
            turn, side.unanswered = side.unanswered, None
            self._pair_of(turn, side, "failed", late=at - turn.until[0])
            side.answers_until = sign.until
        elif sign.action == "speak":
            if not side.own and at <= side.third_until + ROUND:
                side.third_until = BEFORE[0]
                if self._asks_for_more(sign):
                    side.own.append(sign)
            else:
                side.own.append(sign)

    def _asks_for_more(self, speech: Span) -> bool:
        """True if the words of what seems to close an exchange ask for something: they open another."""
        if speech.known is None or not speech.words or speech.words in LISTENING:
            return False
        into = [t.until for t in self._timeline.turns if speech.who in t.to and t.since < speech.since < t.until]
        # A voice that goes on when the answer is over is not waited for, unless it may be for somebody else.
        if into and (self._timeline.tells == "early" or not company(speech, self._timeline)):
            return speech.known > into[-1] and self._is_last(speech)  # else it is of that exchange
        waited = min(speech.until[0] + WORDS_AFTER, speech.since[0] + longest_sound(self._timeline))
        return speech.known[0] <= waited + ROUND or self._is_last(speech)

    def _begins_too(self, side: Side, sign: Span) -> bool:
        """True if a person begins to answer in the very instant of another's sign."""
        signs = [each for each in self._timeline.spans if each.who == side.person and each.to == ROBOT]
        return any(
            each.action not in ("look", "act") and each.since[0] == sign.since[0] and not self._is_noise(each)
            for each in signs
        )

    def _has_spoken(self, asked: Turn, sign: Span) -> bool:
        """True if the robot has begun to say anything, to anybody, after nobody had answered this turn in time."""
        failed = asked.until[0] + self._limit
        return any(
            failed <= since[0] and since < sign.since for turn in self._timeline.turns for since, _ in turn.speech
        )

    def _asked_of_another(self, side: Side, sign: Span) -> Turn | None:
        """What the robot has asked others who have not answered yet when somebody else says this."""
        asked = [each.asked for each in self._sides.values() if each is not side and each.asked is not None]
        last = (side.own[-1].until if side.own else BEFORE)[0]
        at = sign.since[0]
        waiting = [each for each in asked if last < each.until[0] < at]
        return max(waiting, key=lambda each: each.until, default=None)


def is_noise(one: Span, timeline: Timeline) -> bool:
    """True for a sound of which no words come where they would have come, or too late to say anything."""
    if not timeline.is_worded:
        return False
    longest, wait = longest_sound(timeline), (one.until[0] + WORDS_AFTER + ROUND, LAST)
    for turn in timeline.turns:
        for since, until in [(turn.since, turn.until)] if one.who in turn.to else turn.speech:
            if one.to == ROBOT and since < one.since < until:
                if until < one.until:
                    return False
                if one.who in turn.to:
                    longest, wait = WORDS_WAIT, (one.since[0] + WORDS_WAIT + ROUND, LAST)
                    if not company(one, timeline) and _following(one, timeline) < until:
                        wait = BEFORE  # it is told when the next sign begins
                wait = max(wait, until)
    if one.known is None or (one.known > wait and has_spoken_since(one, timeline)):
        return one.seconds <= longest + ROUND
    return False


def company(speech: Span, timeline: Timeline) -> list[str]:
    """Others who are there when somebody is known to speak. Words alone: who is lost when they come was so before."""
    at = _known(speech)[0]
    gone = {
        each.who for each in timeline.away
        if each.until[0] - each.since[0] >= FACE_GRACE and each.since[0] + FACE_GRACE + ROUND < at < each.until[0]
    }  # fmt: skip
    return [each for each in timeline.people if each != speech.who and each not in gone]


def _following(one: Span, timeline: Timeline) -> Instant:
    """When the next sign of a person begins that is not at one time with this."""
    over = one.until
    for each in sorted(timeline.spans, key=lambda each: each.since):
        if each.who == one.who and each.to == ROBOT and each.action != "look" and each.since > one.since:
            if each.since > over:
                return each.since
            over = max(over, each.until)
    return inf, 0


def longest_sound(timeline: Timeline) -> float:
    """Longest sound without words that may be none."""
    return LONGEST_SOUND_TOLD if timeline.tells else LONGEST_SOUND


def has_spoken_since(one: Span, timeline: Timeline) -> bool:
    """True if the person or the robot has begun to say something to the other before the words are known."""
    assert one.known is not None
    own = [
        each.since for each in timeline.spans
        if each.who == one.who and each.action == "speak" and each.to == ROBOT and one.since < each.since < one.known
        and not is_noise(each, timeline)
    ]  # fmt: skip
    robots = [since for turn in timeline.turns if one.who in turn.to for since, _ in turn.speech]
    return any(one.since < since < one.known for since in (*own, *robots))


def _speaks_to_robot(each: Span, person: str) -> bool:
    return each.who == person and each.action == "speak" and each.to == ROBOT


def _is_late(sign: Span) -> bool:
    """True if the words of a speech come when nobody waits for them."""
    return sign.known is not None and sign.known[0] > sign.until[0] + WORDS_AFTER + ROUND


def _words_come(speech: Span) -> float:
    return inf if speech.known is None else speech.known[0]


def _known(act: Span | Turn | Absence) -> Instant:
    """When it is taken into account: a face that is back soon had not gone, and words may alone tell of a speech."""
    if isinstance(act, Absence):
        return act.since[0] + FACE_GRACE, LAST
    return act.known if isinstance(act, Span) and act.is_alone and act.known else act.since


def as_told(events: Sequence[ConnectionEvent]) -> list[Coded]:
    """What recognition has told, as the coder writes it."""
    lives: dict[str, Coded] = {}
    for each in events:
        before = lives.get(each.id)
        if each.kind not in ("adjacency_pair", "backchannel"):
            continue
        state = "completed" if each.kind == "backchannel" else each.state
        is_late = each.retold and each.state == "failed" and each.response is not None
        if before is not None and before.state != "started" and not is_late:
            continue
        late = each.delay if is_late else None
        delay = each.delay if state in ("succeeded", "preempted") else None
        lives[each.id] = Coded(
            each.kind,
            each.initiator,
            each.responder,
            each.started.seconds,
            state,
            delay,
            "" if each.answered_by == each.responder else each.answered_by,
            late,
        )
    return sorted(lives.values())


def rounded(events: Sequence[Coded]) -> list[Coded]:
    """The same, with times to ten microseconds."""
    return [
        Coded(*(round(value, 5) if isinstance(value, float) else value for value in astuple(each))) for each in events
    ]


def only_one_has(told: Sequence[object], coded: Sequence[object]) -> tuple[int, list[str]]:
    """Number of events that are coded, and those that differ."""
    only = [f"told  {each}" for each in told if each not in coded]
    return len(coded), only + [f"coded {each}" for each in coded if each not in told]
