"""Adjacency pair: a first turn that calls for a second, in words, gestures or the manipulation of an object.

Thesis 2.2.3. The delay runs from the end of the first turn and is negative for an interruption; so an answer
that comes while the turn still goes on is known at once, but decided only when the turn has ended.
"""

from collections.abc import Iterable
from math import inf

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.recognition.events.limits import in_time
from engage_hri.services.recognition.events.machine import (
    IDLE,
    EventWriter,
    Machine,
    OngoingEvent,
    SpeechStart,
    TransitionRow,
    table,
)
from engage_hri.services.recognition.events.presence import NEVER
from engage_hri.services.recognition.events.scene import Question

ROBOT_WAITING, HUMAN_WAITING = "robot_waiting", "human_waiting"
INTERRUPTED, RESPONDING = "interrupted", "responding"

TABLE = table(
    TransitionRow(IDLE, "robot_asks", ROBOT_WAITING, ("started",)),
    TransitionRow(IDLE, "human_asks", HUMAN_WAITING, ("started",)),
    TransitionRow(IDLE, "third_turn", IDLE),
    TransitionRow(ROBOT_WAITING, "turn_ends", ROBOT_WAITING),
    TransitionRow(ROBOT_WAITING, "responder_interrupts", INTERRUPTED),
    TransitionRow(ROBOT_WAITING, "human_answers", RESPONDING, ("succeeded",)),
    TransitionRow(ROBOT_WAITING, "other_answers", IDLE, ("preempted",)),
    TransitionRow(ROBOT_WAITING, "one_of_several_answers", IDLE, ("succeeded", "completed")),
    TransitionRow(ROBOT_WAITING, "repaired", IDLE, ("succeeded", "completed")),
    TransitionRow(ROBOT_WAITING, "limit", IDLE, ("failed",)),
    TransitionRow(ROBOT_WAITING, "withdraw", IDLE, ("withdrawn",)),
    TransitionRow(ROBOT_WAITING, "person_gone", IDLE, ("failed",)),
    TransitionRow(ROBOT_WAITING, "supersede", IDLE, ("superseded",)),
    TransitionRow(HUMAN_WAITING, "turn_ends", HUMAN_WAITING),
    TransitionRow(HUMAN_WAITING, "turn_goes_on", HUMAN_WAITING),
    TransitionRow(HUMAN_WAITING, "responder_interrupts", INTERRUPTED),
    TransitionRow(HUMAN_WAITING, "robot_answers", RESPONDING, ("succeeded",)),
    TransitionRow(HUMAN_WAITING, "limit", IDLE, ("failed",)),
    TransitionRow(HUMAN_WAITING, "person_gone", IDLE, ("withdrawn",)),
    TransitionRow(HUMAN_WAITING, "supersede", IDLE, ("superseded",)),
    TransitionRow(INTERRUPTED, "turn_ends", RESPONDING, ("succeeded",)),
    TransitionRow(INTERRUPTED, "was_listening", ROBOT_WAITING),
    TransitionRow(RESPONDING, "response_ends", IDLE, ("completed",)),
    TransitionRow(RESPONDING, "repaired", IDLE, ("completed",)),
    TransitionRow(RESPONDING, "supersede", IDLE, ("completed",)),
    TransitionRow(RESPONDING, "person_gone", IDLE, ("completed",)),
)


def _spoken(person: str, action: Action, at: Seconds) -> tuple[SpeechStart, ...]:
    """Speech of which a turn consists that a person has begun with an action; none if it is wordless."""
    return (SpeechStart(person, at),) if action == "speak" else ()


class AdjacencyPair(Machine):
    """The adjacency pair between one person and the robot: at most one at a time, a new first turn replaces it.

    limit: time limit of a person's pair. third_turn: time after the answer in which its initiator may close the
    exchange with a third turn. patience: seconds for which an unfinished turn of the robot still counts.
    """

    TABLE = TABLE

    def __init__(self, writer: EventWriter, *, limit: Seconds, third_turn: Seconds, patience: Seconds) -> None:
        super().__init__(writer)
        self._limit = limit
        self._third_turn = third_turn
        self._patience = patience
        self._by_robot = False
        self._asked_with: Action = "speak"
        self._turn_end: Seconds | None = None
        self._last_heard: Seconds | None = None
        self._response_until: Seconds | None = None
        self._third_turn_of = ""
        self._third_turn_until: Seconds = 0.0
        self._unanswered: OngoingEvent | None = None
        """The robot's last pair, if its limit passed without an answer and nobody has begun a turn since."""
        self.late_answer: Action | None = None
        """What the person answers with, late, as long as that goes on."""
        self._forgotten_at: Seconds = NEVER
        """When the robot has first said something after that limit; until then, when it has last done so."""
        self.interrupted_until: Seconds = NEVER
        """End of the robot's last turn that was answered before it ended: all said in it is part of that answer."""

    @property
    def robot_holds_turn(self) -> bool:
        """True from the beginning of the robot's first turn to its end, pauses in its speech included."""
        return self._by_robot and self._turn_end is None and self.state in (ROBOT_WAITING, INTERRUPTED)

    @property
    def is_interrupted(self) -> bool:
        """True if the first turn, which goes on, has been answered."""
        return self.state == INTERRUPTED

    @property
    def interrupted_since(self) -> Seconds:
        """Start of the answer to the robot's first turn, which goes on; infinite: there is none."""
        is_by_robot = self.state == INTERRUPTED and self._by_robot
        return self.event.response_since if self.event is not None and is_by_robot else inf

    @property
    def deadline(self) -> Seconds:
        if self.event is None or self.state not in (ROBOT_WAITING, HUMAN_WAITING, INTERRUPTED):
            return inf
        if self._turn_end is not None:
            return self._turn_end + (self.event.limit or self._limit)
        if self._by_robot and self._last_heard is not None:
            return self._last_heard + self._patience
        return inf

    def expire(self, at: Seconds) -> None:
        """Decide the pair at its deadline: no answer within the limit, or a turn of the robot without an end."""
        if self.state == INTERRUPTED:
            self.turn_ends(at)
        elif self._turn_end is None:
            self.step("withdraw", at)
        else:
            self._unanswered = self.event if self._by_robot else None
            if self._forgotten_at < at:
                self._forgotten_at = inf
            self.step("limit", at)

    def _pass_limit(self, at: Seconds) -> None:
        """Decide a pair whose limit lies before `at`: it was open only because somebody may have answered in time."""
        if self.state in (ROBOT_WAITING, HUMAN_WAITING) and not in_time(at, self.deadline):
            self.expire(self.deadline)

    # -- first turn ---------------------------------------------------------------------------------------------

    def robot_asks(self, event: OngoingEvent) -> None:
        """Begin a pair with the robot's first turn. A pair still pending is superseded; see `make_way`."""
        self.make_way(event.started)
        self._open(event, by_robot=True)
        self._last_heard = event.started
        self.step("robot_asks", event.started)

    def make_way(self, at: Seconds) -> None:
        """End a pending pair because the robot speaks. To a person who waits for an answer the speech is that."""
        self._pass_limit(at)
        if self.state == HUMAN_WAITING and self._turn_end is not None:
            self._answer("robot_answers", "speak", at)
        if self.state == INTERRUPTED:
            self.turn_ends(at)
        if self.state == RESPONDING:
            self._end_response("supersede", at)
        elif self.state != IDLE:
            self.step("supersede", at)

    def robot_cuts_into_turn(self, at: Seconds) -> bool:
        """Take a first turn of the robot as the answer to a person who still speaks. False if nobody does so.

        The delay is then negative, and known only when the person has finished. People begin like this in half of all
        changes of speaker, so it is no other event (thesis 2.2.3). The robot's own pair needs another machine.
        """
        if self.state == HUMAN_WAITING and self._turn_end is None:
            self._answer("robot_answers", "speak", at)
        return self.is_cut_into

    @property
    def is_cut_into(self) -> bool:
        """True if the robot has begun its answer, and the person still speaks."""
        return self.state == INTERRUPTED and not self._by_robot

    def human_asks(self, event: OngoingEvent, action: Action) -> None:
        """Begin a pair with a person's first turn: `action` is speech, or the manipulation of an object."""
        self._open(event, by_robot=False)
        self._asked_with = action
        self.step("human_asks", event.started)

    def _open(self, event: OngoingEvent, *, by_robot: bool) -> None:
        self.forget_unanswered()
        self.event = event
        self._by_robot = by_robot
        self._turn_end = self._last_heard = self._response_until = None

    def resume(self, event: OngoingEvent, at: Seconds, *, by_robot: bool) -> None:
        """Begin a pair that a former life of recognition has told, and whose first turn is over by now."""
        self._open(event, by_robot=by_robot)
        self.step("robot_asks" if by_robot else "human_asks", event.started)
        self.turn_ends(at)

    def is_turn(self, turn: str) -> bool:
        """True if `turn` (empty: any) is the robot's turn with which this pair began."""
        return self.event is not None and self._by_robot and turn in ("", self.event.turn)

    def is_third_turn(self, person: str, at: Seconds) -> bool:
        """True if speech of `person` at `at` closes the last pair: its initiator's, soon after the answer."""
        return self.state == IDLE and person == self._third_turn_of and in_time(at, self._third_turn_until)

    def third_turn(self, at: Seconds) -> None:
        self._third_turn_of = ""
        self.step("third_turn", at)

    def turn_ends(self, at: Seconds) -> None:
        """End the first turn: the response clock starts, and an interruption gets its negative delay."""
        if self.event is None or self._turn_end is not None:
            return
        if self.state == INTERRUPTED:
            self._turn_end = at
            self._succeed("turn_ends", at)
            if self._response_until is not None:
                self._end_response("response_ends", at)
        elif self.state in (ROBOT_WAITING, HUMAN_WAITING):
            self._turn_end = at
            self.step("turn_ends", at)

    def robot_heard(self, at: Seconds | None) -> None:
        """Note when the robot last fell silent; None while it speaks."""
        if self.robot_holds_turn:
            self._last_heard = at

    def abort(self, at: Seconds) -> None:
        """End a turn of the robot that was cut off: an interruption is the answer, else the pair is withdrawn."""
        if self.state == INTERRUPTED and self._by_robot:
            self.turn_ends(at)
        elif self.state == ROBOT_WAITING:
            self.step("withdraw", at)

    @property
    def asked_until(self) -> Seconds:
        """End of the person's turn that waits for an answer; if none does, before all times."""
        return self._turn_end if self.state == HUMAN_WAITING and self._turn_end is not None else NEVER

    @property
    def question(self) -> Question | None:
        """The robot's question that waits for an answer, its turn being over; None: none does."""
        if self.state != ROBOT_WAITING or self._turn_end is None or self.event is None:
            return None
        return Question(self.event.accept, self._turn_end, self.deadline)

    def other_answers(self, person: str, action: Action, at: Seconds) -> None:
        """Take the answer of somebody who was not asked: it is no failure of who was."""
        if self.event is not None and self.question is not None:
            self.event.response, self.event.answered_by = action, person
            self.event.delay, self.event.response_since = at - self.question.since, at
            self.event.spoken = _spoken(person, action, at)
            self.step("other_answers", at)

    def answered_for_all(self, answered: OngoingEvent, at: Seconds) -> None:
        """Take what has answered the robot's question to several people: it answers for each of them."""
        event = self.event
        if event is None or event is answered or not self.is_turn(answered.turn) or self.state != ROBOT_WAITING:
            return
        event.response, event.answered_by, event.delay = answered.response, answered.answered_by, answered.delay
        event.response_since = answered.response_since
        event.spoken = answered.spoken
        is_asked = answered.answered_by == answered.responder
        self.step("one_of_several_answers" if is_asked else "other_answers", at)

    # -- second turn --------------------------------------------------------------------------------------------

    @property
    def may_be_answered(self) -> bool:
        """True if the robot asks, or waits for an answer of the person."""
        return self.state == ROBOT_WAITING

    def may_be_answered_with(self, action: Action) -> bool:
        """True if the robot waits for an answer of the person, and `action` is one."""
        return self.event is not None and self.state == ROBOT_WAITING and action in self.event.accept

    def human_begins(self, action: Action, at: Seconds, confidence: Probability = 1.0) -> bool:
        """Take a person's action as the answer to the robot's turn, in time. False if it is none."""
        self._pass_limit(at)
        is_first = self.may_be_answered_with(action)
        if self.event is None or not (is_first or self._is_earlier_answer(action, at)):
            return False
        self.event.rests_on(confidence)
        self.event.spoken = _spoken(self.event.responder, action, at)
        if is_first:
            self._answer("human_answers", action, at)
        else:
            self.event.response, self.event.response_since, self._response_until = action, at, None
        return True

    def is_answered_in(self, speeches: Iterable[Seconds]) -> None:
        """Take what is said beside the gesture that answers. speeches: their starts."""
        if self.event is not None:
            self.event.spoken += tuple(SpeechStart(self.event.responder, since) for since in speeches)

    def answers_late(self, action: Action, at: Seconds, confidence: Probability) -> bool:
        """Take the first accepted action after the limit as the answer of the pair that failed, late.

        The pair stays failed, for its limit is what it was judged by; it is told again with the answer and its delay.
        Otherwise a slow person would fail twice: by not answering, and by a question that nobody has asked.
        """
        event = self._unanswered
        if event is None or self._turn_end is None or action not in event.accept or at > self._forgotten_at:
            return False
        self.forget_unanswered()
        self.late_answer = action
        event.rests_on(confidence)
        event.response, event.delay = action, at - self._turn_end
        event.spoken = _spoken(event.responder, action, at)
        self._writer.publish(event, "failed", at, retold=True)
        return True

    def forget_unanswered(self) -> None:
        """Begin another turn: from now on nothing answers the robot's turn before, however late."""
        self._unanswered = None

    def robot_says(self, at: Seconds) -> None:
        """Note that the robot says something, to whomever: nothing that begins later answers what has failed before.

        That it has failed, and what was said before, may be known later.
        """
        if self._unanswered is None or at < self._forgotten_at:
            self._forgotten_at = at

    def _is_earlier_answer(self, action: Action, at: Seconds) -> bool:
        """True if the action, known only now, began before the one that has been taken for the answer so far."""
        return at < self.interrupted_since < inf and self.event is not None and action in self.event.accept

    def was_listening(self, since: Seconds) -> bool:
        """Wait on: the words of this speech, taken for the answer during the robot's turn, are a listener's.

        False if it has not been taken for the answer.
        """
        if self.event is None or self.interrupted_since != since or self.event.response != "speak":
            return False
        self.event.response, self.event.spoken = None, ()
        self.step("was_listening", since)
        return True

    def human_goes_on(self, action: Action, at: Seconds) -> bool:
        """Continue a person's first turn that had ended with another `action`. False if none waits for an answer."""
        self._pass_limit(at)
        if self.state != HUMAN_WAITING:
            return False
        self._asked_with = action
        self._turn_end = None
        if self.event is not None:
            self.event.spoken += _spoken(self.event.initiator, action, at)
        self.step("turn_goes_on", at)
        return True

    def robot_begins(self, action: Action, at: Seconds) -> None:
        """Take speech or a gesture of the robot: it answers a waiting person, or goes on with the answer."""
        if self.state == HUMAN_WAITING and in_time(at, self.deadline):
            self._answer("robot_answers", action, at)
        elif self.event is not None and self.is_cut_into and action == self.event.response:
            self._response_until = None

    def _answer(self, given: str, action: Action, at: Seconds) -> None:
        assert self.event is not None
        self.event.response, self.event.response_since = action, at
        if self._turn_end is None:
            self.step("responder_interrupts", at)
        else:
            self._succeed(given, max(at, self._turn_end))

    def _succeed(self, given: str, at: Seconds) -> None:
        """Take the answer to a turn that is over. It may have begun before that."""
        assert self.event is not None
        assert self._turn_end is not None
        self.event.delay = self.event.response_since - self._turn_end
        if self._by_robot and self.event.delay <= 0:
            self.interrupted_until = self._turn_end
        self.step(given, at)

    def ends(self, action: Action, at: Seconds, *, by_robot: bool) -> None:
        """End an action of person or robot: it may be the person's first turn, or the response."""
        self.late_answer = None if not by_robot and action == self.late_answer else self.late_answer
        if self.event is None:
            return
        if by_robot == self._by_robot:
            if not by_robot and action == self._asked_with:
                self.turn_ends(at)
        elif self.event.response == action and self.state == RESPONDING:
            self._end_response("response_ends", at)
        elif self.event.response == action and self.state == INTERRUPTED:
            self._response_until = at

    def _end_response(self, given: str, at: Seconds, until: Seconds | None = None) -> None:
        assert self.event is not None
        end = self._response_until if until is None else until
        end = at if end is None else end
        self.event.duration = max(0.0, end - self.event.response_since)
        self._third_turn_of = self.event.initiator
        self._third_turn_until = end + self._third_turn
        self.step(given, at)

    def repaired(self, at: Seconds) -> None:
        """Close the robot's pair by its third turn, whether or not the second was seen."""
        if not self._by_robot:
            return
        if self.state == INTERRUPTED:
            self.turn_ends(at)
        if self.state == RESPONDING:
            self._end_response("repaired", at)
        elif self.state == ROBOT_WAITING:
            self.step("repaired", at)

    def block_ended(self, block: str, at: Seconds, *, aborted: bool) -> None:
        """End the turn of a pair without a named turn: there the turn is the block."""
        if self.event is not None and self.event.block == block and not self.event.turn:
            if aborted:
                self.abort(at)
            else:
                self.turn_ends(at)

    def answered_block_ended(self, at: Seconds) -> None:
        """End an answer of the robot without words, for the fragment that gave it is over."""
        if self.state == RESPONDING and not self._by_robot:
            self._end_response("response_ends", at)

    def take_over(self, other: "AdjacencyPair", person: str, former: str) -> None:
        """Take what may follow on a pair that is over: a late answer, or a third turn.

        other: pair of the person by another id, `former`. person: the one that is kept.
        """
        self.interrupted_until = max(self.interrupted_until, other.interrupted_until)
        if self.event is not None or other.state != IDLE:
            return
        if self._unanswered is None and other._unanswered is not None:
            self._unanswered, self._turn_end = other._unanswered, other._turn_end
            self._forgotten_at = other._forgotten_at
            self._unanswered.responder = person
        if other._third_turn_until > self._third_turn_until:
            self._third_turn_until = other._third_turn_until
            self._third_turn_of = person if other._third_turn_of == former else other._third_turn_of

    def person_gone(self, at: Seconds, until: Seconds) -> None:
        self.forget_unanswered()
        if self.state == INTERRUPTED:
            self.turn_ends(at)
        if self.state == RESPONDING:
            self._end_response("person_gone", at, until)
        elif self.state != IDLE:
            self.step("person_gone", at)
