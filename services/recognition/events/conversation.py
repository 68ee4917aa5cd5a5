"""Dialogue of a person and the robot: who speaks, and what follows from it for the turns and signs of both. Pure.

What one does while the other has the floor is a sign of a listener (`Listener` of the person, a `Backchannel` of the
robot) until it turns out to be a turn; all else is a turn at once (`Exchange`). The robot has the floor while it
speaks to the person, and from the first word to the end of its turn; the person has it while they speak. Thesis 2.2.3
and 2.2.4.
"""

from math import inf

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.backchannel import BRIEF, UNDECIDED, Backchannel
from engage_hri.services.recognition.events.exchange import Exchange
from engage_hri.services.recognition.events.limits import in_time
from engage_hri.services.recognition.events.listener import Listener
from engage_hri.services.recognition.events.listener_sign import SignPart
from engage_hri.services.recognition.events.machine import IDLE, EventWriter, OngoingEvent
from engage_hri.services.recognition.events.scene import SessionScene
from engage_hri.services.text.listening import is_listening


class Dialogue:
    """Dialogue of one person with the robot."""

    def __init__(self, id: str, scene: SessionScene, config: RecognitionConfig, writer: EventWriter) -> None:
        self.id = id
        self.exchange = Exchange(id, scene, config, writer)
        self.listener = Listener(id, scene, config, writer, self.exchange)
        self.robot_backchannel = Backchannel(writer, limit=config.backchannel_limit)
        self.robot_speaks_since = scene.robot_speaks_to(id)
        """Time when the robot began what it says to this person now; None: it says nothing to them."""
        self._speech: SignPart | None = None
        """What the person says now."""
        self._scene = scene
        self._config = config
        self._writer = writer

    # -- time ---------------------------------------------------------------------------------------------------

    @property
    def deadline(self) -> Seconds:
        """Time of the next step that is due by itself; infinite: there is none."""
        due = inf if self.exchange.pair.event is None else self._pair_deadline()
        if self.listener.sign is not None or self.robot_backchannel.event is not None:
            due = min(due, self.listener.deadline, self.robot_backchannel.deadline)
        return due

    def pass_time(self, at: Seconds) -> None:
        """Take the first step that is due at `at`, the `deadline`."""
        if self.listener.deadline == at:
            self.listener.pass_time(at)
        elif self.robot_backchannel.deadline == at:
            self._robot_takes_floor(at)
        else:
            self.exchange.pair.expire(at)

    def _pair_deadline(self) -> Seconds:
        """Deadline of the pair; infinite while speech of anybody that began in time may yet be part of it."""
        pair, sign = self.exchange.pair, self.listener.sign
        at = pair.deadline
        if at == inf or pair.is_interrupted:
            return at
        began_in_time = sign is not None and any(in_time(speech.since, at) for speech in sign.speeches)
        if began_in_time and (pair.may_be_answered_with("speak") or not pair.may_be_answered):
            return inf
        return inf if self._scene.may_be_answered(self.id, at) and pair.question is not None else at

    # -- whose floor it is --------------------------------------------------------------------------------------

    @property
    def robot_holds_floor(self) -> bool:
        return self.robot_speaks_since is not None or self.exchange.pair.robot_holds_turn

    def is_into_turn(self, at: Seconds) -> bool:
        """True if what the person does at `at` is in the robot's turn. It may be known only now, and be earlier."""
        if self.exchange.pair.event is not None and self.exchange.pair.robot_holds_turn:
            return at >= self.exchange.pair.event.started
        return self.robot_speaks_since is not None and at >= self.robot_speaks_since

    @property
    def is_spoken_to(self) -> bool:
        """True while the robot speaks to the person, or waits for an answer."""
        return self.robot_holds_floor or self.exchange.pair.may_be_answered_with("speak")

    @property
    def is_under_way(self) -> bool:
        """True if one holds the floor, or a pair, a sign or a backchannel is open."""
        is_open = self.exchange.is_open or self.listener.sign is not None or self.robot_backchannel.event is not None
        return is_open or self._speech is not None or self.robot_speaks_since is not None

    # -- the person ---------------------------------------------------------------------------------------------

    def speaks(self, speech: SignPart, *, beside: bool = False) -> None:
        """Take the beginning of speech. beside: the robot says something to others."""
        if self._speech is not None:
            return
        self._speech, at = speech, speech.since
        if self.is_into_turn(at) or beside:
            self._writer.interject(self.id, at, "open", at)
            # A line that was typed has no length by which it could be judged: its words alone say what it is.
            if self._scene.lines.get(self.id) != at or is_listening(speech.words):
                self.listener.begins(speech, beside=not self.robot_holds_floor)
                return
            self._writer.interject(self.id, at, "interruption", at)
        else:
            self._writer.decide_interjection(self.id, at, "answer", at)
            self.listener.next_begins()
        if not self.exchange.is_before_question(at):
            self.exchange.human_turn("speak", at, speech.confidence)
            if self.robot_speaks_since is not None and at < self.robot_speaks_since:
                self.exchange.pair.robot_begins("speak", self.robot_speaks_since)  # which is the answer

    def falls_silent(self, at: Seconds) -> None:
        if self._speech is None:
            return
        self._speech.until, self._speech = at, None
        self.action_ends("speak", at)
        self._floor_is_free(at)

    def gestures(self, action: Action, at: Seconds, confidence: Probability = 1.0) -> None:
        """Take a nod, a shake or a point of the person."""
        sign = self.listener.sign
        if self._speech is not None and (sign is None or not sign.going_on("speak")):
            self.listener.goes_with_words(SignPart(action, at, confidence))
        elif self.robot_holds_floor or (sign is not None and sign.until is None):
            self.listener.begins(SignPart(action, at, confidence))
        elif not self.exchange.pair.human_begins(action, at, confidence):
            self.exchange.pair.answers_late(action, at, confidence)

    def action_ends(self, action: Action, at: Seconds) -> None:
        """End an action of the person for the sign that it is part of, and for the pairs."""
        self.listener.ends(action, at)
        self.exchange.ends(action, at, by_robot=False)

    def manipulates(self, at: Seconds, confidence: Probability = 1.0) -> None:
        self.exchange.human_turn("act", at, confidence)

    def goes_on(self, part: SignPart) -> None:
        """Take an action of the person that goes on, known only now. It may be the answer, or more of a turn."""
        if part.action == "speak" and self._speech is None:
            self._speech = part
        self.exchange.goes_on(part.action, part.since, part.confidence)

    def understand(self, speech: SignPart, at: Seconds) -> None:
        """Judge what was said as a sign by its words, whenever they come."""
        since = speech.since
        in_turn, is_last = self.is_into_turn(since), self._scene.is_last(self.id, since, at)
        self.listener.understand(speech, at, in_turn=in_turn, is_last=is_last)
        self.exchange.understand(speech, is_last=is_last)

    def person_gone(self, at: Seconds, until: Seconds) -> None:
        self.exchange.person_gone(at, until)
        self.listener.person_gone(at, until)
        self.robot_backchannel.person_gone(at, until)
        self._speech = None

    # -- the robot ----------------------------------------------------------------------------------------------

    def robot_speaks(self, at: Seconds) -> None:
        """Take the beginning of the robot's speech, which is no backchannel that was announced."""
        pair, self.robot_speaks_since = self.exchange.pair, at
        pair.robot_heard(None)
        if self._speech is not None and not pair.robot_holds_turn and not self.exchange.is_cut_into:
            if self.robot_backchannel.state != BRIEF:
                self.robot_backchannel.begin(self._robots_backchannel(at), "speaks")
        else:
            pair.robot_begins("speak", at)

    def robot_falls_silent(self, at: Seconds) -> None:
        self.robot_speaks_since = None
        if self.listener.is_beside:
            self.listener.robots_turn_ends(at)
        self.exchange.pair.robot_heard(at)
        listening, since = self.robot_backchannel, self.robot_backchannel.undecided_since
        if listening.state == BRIEF or (since is not None and in_time(at, since + self._config.backchannel_limit)):
            listening.ends(at)
        self.exchange.ends("speak", at, by_robot=True)
        self._floor_is_free(at)

    def robot_gestures(self, action: Action, at: Seconds, *, listens: bool) -> None:
        """Take a nod, a shake, a point or an "uh-huh" of the robot. listens: it is an announced backchannel."""
        if self._speech is None or action == "point":
            if not listens:
                self.exchange.pair.robot_begins(action, at)
        elif self.robot_backchannel.state == IDLE:
            self.robot_backchannel.begin(self._robots_backchannel(at), "gestures")

    def robot_goes_on(self, action: Action, since: Seconds) -> None:
        """Take speech or a gesture of the robot that goes on, known only now. It may be the answer."""
        if action == "speak":
            self.robot_speaks_since = since
            self.exchange.pair.robot_heard(None)
        if self.exchange.pair.event is not None and since >= self.exchange.pair.event.started:
            self.exchange.pair.robot_begins(action, since)

    def robot_gesture_ends(self, action: Action, at: Seconds) -> None:
        if self.robot_backchannel.state == BRIEF and action != "point":
            self.robot_backchannel.ends(at)
        self.exchange.ends(action, at, by_robot=True)

    def robot_asks(self, event: OngoingEvent) -> None:
        self.listener.next_begins()
        self._drop_robots_sign(event.started)
        self.exchange.robot_asks(event)
        if self.robot_speaks_since is not None:
            self.exchange.pair.robot_heard(None)

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

    def is_answered(self, at: Seconds, *, repairs: bool) -> None:
        """Take the robot's second turn, or a third one that repairs. Either answers a waiting person."""
        if repairs:
            self.exchange.pair.repaired(at)
        self._drop_robots_sign(at)
        self.exchange.pair.robot_begins("speak", at)

    def _robot_takes_floor(self, at: Seconds, given: str = "limit") -> None:
        self.exchange.pair.robot_begins("speak", self.robot_backchannel.takes_floor(given, at))

    def _drop_robots_sign(self, at: Seconds) -> None:
        """Take what the robot says, and might be a backchannel, for a turn: it is known now that it is one."""
        if self.robot_backchannel.state == UNDECIDED:
            self.robot_backchannel.takes_floor("outlasts_turn", at)

    def _robots_backchannel(self, at: Seconds) -> OngoingEvent:
        return OngoingEvent(
            kind="backchannel", initiator=self.id, responder=self._scene.robot, started=at, cause="turn"
        )

    # -- ends of the robot's turn -------------------------------------------------------------------------------

    def turn_ended(self, turn: str, at: Seconds) -> None:
        if self.exchange.pair.is_turn(turn):
            self.turn_ends(at)

    def turn_ends(self, at: Seconds) -> None:
        # Before the pair is decided: of several answers during the turn the one that began first counts.
        if self.robot_speaks_since is None:
            self.listener.robots_turn_ends(at)
        self.exchange.pair.turn_ends(at)
        self._floor_is_free(at)

    def cut_off(self, at: Seconds, *, turn: str) -> None:
        """Take what goes on for the answer to a robot's turn that is cut off.

        Who speaks into the turn at that moment has taken the floor, and so has answered, however long the speech was
        until then. Else the limit of a backchannel and the robot's own limit for giving way would be two judges.
        """
        if self.exchange.pair.is_turn(turn):
            self.listener.robots_turn_ends(at, "interruption")
            if self.exchange.pair.is_interrupted:
                self.exchange.pair.turn_ends(at)

    def abort(self, at: Seconds, *, turn: str) -> None:
        """End the pair of a robot's turn that was cut off, which nobody has answered."""
        if self.exchange.pair.is_turn(turn):
            self.exchange.pair.abort(at)
        self._floor_is_free(at)

    def withdraw(self, event: OngoingEvent, at: Seconds, *, is_orphan: bool) -> None:
        """Withdraw a pair of the robot; see `Talk.withdraw`."""
        if self.exchange.pair.event is event and (self.exchange.pair.robot_holds_turn or not is_orphan):
            self.exchange.pair.abort(at)

    def block_ended(self, block: str, at: Seconds, *, aborted: bool) -> None:
        self.exchange.block_ended(block, at, aborted=aborted)
        announced = self.robot_backchannel.event
        if announced is not None and announced.block == block:
            self.robot_backchannel.ends(at)
        self._floor_is_free(at)

    def _floor_is_free(self, at: Seconds) -> None:
        """Turn undecided speech that outlasts the other's turn into a turn of its own."""
        if not self.robot_holds_floor and not self.listener.is_beside:
            self.listener.robots_turn_ends(at)
        if self.robot_backchannel.state == UNDECIDED and self._speech is None:
            self._robot_takes_floor(at, "outlasts_turn")
