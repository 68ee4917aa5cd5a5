"""Exchange of turns between one person and the robot: what each turn is of, and the pairs that they make. Pure.

A turn of the person is the first of these that it can be:

1. the answer to the robot's question;
2. part of the exchange that goes on;
3. the answer to what the robot has asked somebody else, if that came after all that the person waits for;
4. the late answer to a question whose limit has passed;
5. more of a turn of the person's own that waits for the robot;
6. a third turn, which closes the last exchange: an acknowledgment, an assessment or thanks (Schegloff 2007);
7. a first turn, which opens a pair.

By its place alone a speech may be a third turn or a first one. Its words tell, whenever they come.

So nobody who answers slowly fails twice, by not answering and by a question that nobody has asked. The robot may
begin a first turn while the person still speaks: it answers that person's pair, and asks. Half of all changes of
speaker overlap, so this is no mistake, and for a while there are two pairs. Thesis 2.2.3.
"""

from collections.abc import Iterator, Sequence

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.adjacency_pair import INTERRUPTED, RESPONDING, AdjacencyPair
from engage_hri.services.recognition.events.listener_sign import SignPart
from engage_hri.services.recognition.events.machine import IDLE, EventWriter, OngoingEvent, SpeechStart
from engage_hri.services.recognition.events.presence import NEVER
from engage_hri.services.recognition.events.scene import SessionScene
from engage_hri.services.text.listening import is_content, says_words

TURN_PATIENCE: Seconds = 12.0
"""Time after the robot's last word for which its unfinished turn still counts; longer than the silence after which
generation closes a turn (10 s). Also the time, after the limit, for which an anchor that does not come is waited for.
Ours."""


class Exchange:
    """The turns of one person and the robot. `pair` is the present pair."""

    def __init__(self, id: str, scene: SessionScene, config: RecognitionConfig, writer: EventWriter) -> None:
        self._id = id
        self._scene = scene
        self._config = config
        self._writer = writer
        self.pair = self._new_pair()
        self._cut_into: list[tuple[AdjacencyPair, str]] = []
        """Pairs of the person whose first turn still goes on although the robot has answered with a first turn of its
        own, each with the block of that turn."""
        self._closing: Seconds = NEVER
        """Start of the speech that has been taken for a third turn without words."""

    def _new_pair(self) -> AdjacencyPair:
        return AdjacencyPair(
            self._writer, limit=self._config.adjacency_pair_limit, third_turn=self._config.third_turn_limit,
            patience=TURN_PATIENCE,
        )  # fmt: skip

    @property
    def is_open(self) -> bool:
        return self.pair.event is not None or any(pair.event is not None for pair, _ in self._cut_into)

    @property
    def is_cut_into(self) -> bool:
        """True if the robot has begun to answer the person, who still speaks: what it says then is of that answer."""
        return any(pair.is_cut_into for pair in self._pairs())

    def _pairs(self) -> Iterator[AdjacencyPair]:
        yield from (pair for pair, _ in self._cut_into)
        yield self.pair

    # -- the person ---------------------------------------------------------------------------------------------

    def is_before_question(self, at: Seconds) -> bool:
        """True if what the person has said at `at` is known only now, and the robot has begun another pair since."""
        return self.pair.event is not None and self.pair.may_be_answered and at < self.pair.event.started

    def human_turn(self, action: Action, at: Seconds, confidence: Probability, until: Seconds | None = None) -> None:
        """Take speech, or a manipulation, as a turn of the person. until: its end, if it is over."""
        pair = self.pair
        if pair.human_begins(action, at, confidence):
            pass
        elif pair.state in (INTERRUPTED, RESPONDING) or pair.late_answer is not None:
            return  # it is part of this exchange
        elif self._scene.answers_for_another(self._id, action, at, after=pair.asked_until):
            pair.forget_unanswered()
        elif pair.answers_late(action, at, confidence) or pair.human_goes_on(action, at):
            pass
        elif action == "speak" and pair.is_third_turn(self._id, at) and self._may_close(at):
            pair.third_turn(at)
        elif pair.state == IDLE:
            event = OngoingEvent(
                kind="adjacency_pair", initiator=self._id, responder=self._scene.robot, started=at,
                limit=self._config.adjacency_pair_limit, confidence=confidence,
                spoken=(SpeechStart(self._id, at),) if action == "speak" else (),
            )  # fmt: skip
            pair.human_asks(event, action)
        if until is not None:
            self.ends(action, until, by_robot=False)

    def _may_close(self, since: Seconds) -> bool:
        """True if a speech asks for nothing, as far as its words are known."""
        words = self._writer.text_of(self._id, since)
        self._closing = NEVER if says_words(words) else since
        return not says_words(words) or is_content(words)

    def understand(self, part: SignPart, *, is_last: bool) -> None:
        """Take the words of a speech that seemed to close an exchange: if they ask for something it has opened one.

        is_last: neither has begun to say anything since.
        """
        if part.since == self._closing and says_words(part.words):
            self._closing = NEVER
            if is_last and not is_content(part.words):
                self.human_turn("speak", part.since, part.confidence, part.until)

    def take(self, part: SignPart, beside: Sequence[Seconds] = ()) -> None:
        """Take a part of a sign that turns out to be a turn: speech may be any, a gesture only an answer.

        beside: starts of what is said with a gesture: its words are those of the answer.
        """
        if part.action != "speak":
            if self.pair.human_begins(part.action, part.since, part.confidence):
                self.pair.is_answered_in(beside)
                if part.until is not None:
                    self.pair.ends(part.action, part.until, by_robot=False)
        elif not self.is_before_question(part.since) and part.since >= self.pair.interrupted_until:
            self.human_turn("speak", part.since, part.confidence, part.until)

    def goes_on(self, action: Action, since: Seconds, confidence: Probability) -> None:
        """Take an action of the person that goes on, known only now: it is the answer, or more of a turn."""
        pair = self.pair
        if pair.event is None or since < pair.event.started:
            return
        is_answer = pair.human_begins(action, since, confidence) or pair.answers_late(action, since, confidence)
        if not is_answer and action in ("speak", "act"):
            pair.human_goes_on(action, since)

    def person_gone(self, at: Seconds, until: Seconds) -> None:
        for pair in self._pairs():
            pair.person_gone(at, until)

    # -- both ---------------------------------------------------------------------------------------------------

    def ends(self, action: Action, at: Seconds, *, by_robot: bool) -> None:
        """End an action for all pairs, those cut into and the present one."""
        for pair in self._pairs():
            pair.ends(action, at, by_robot=by_robot)

    # -- the robot ----------------------------------------------------------------------------------------------

    def robot_asks(self, event: OngoingEvent) -> None:
        """Take a first turn of the robot, maybe into the person's words."""
        if self.pair.robot_cuts_into_turn(event.started):
            self._cut_into = [each for each in self._cut_into if each[0].state != IDLE]
            self._cut_into.append((self.pair, event.block))
            self.pair = self._new_pair()
        self.pair.robot_asks(event)

    def block_ended(self, block: str, at: Seconds, *, aborted: bool) -> None:
        for pair, answer in self._cut_into:
            if answer == block:
                pair.answered_block_ended(at)
        self.pair.block_ended(block, at, aborted=aborted)
