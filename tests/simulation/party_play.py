"""A party and a robot that asks now and then, played through recognition; with the truth beside what it tells."""

import random
from collections.abc import Iterator
from typing import NamedTuple

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import TurnSignal
from engage_hri.schemas.blocks import BlockProgress
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, OngoingActions, Utterance
from engage_hri.schemas.recognition import ConnectionEvent, RequestEvent, SignalTurn
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.intake import Intake, reads
from engage_hri.services.reports.ongoing_actions import OngoingActionTracker
from engage_hri.services.runtime.intake import Input, PublishMessage, StepClock
from engage_hri.services.simulation.party import NAMES, Party, Saying
from tests.recognition.observations import ROBOT, request_event, stamp, world

EVERY = (12.0, 20.0)
"""Least and most seconds between two questions of the robot."""


class Question(NamedTuple):
    """A question of the robot: to whom, when it began and ended."""

    to: str
    began: float
    ended: float


class Play:
    """The play. tells: perception knows to whom people speak."""

    def __init__(self, people: int, seed: int, *, tells: bool = False) -> None:
        self.chance = random.Random(f"{seed} robot")
        self.party = Party(NAMES[:people], random.Random(seed), ROBOT, f"life-{seed}", tells=tells)
        self.intake = Intake(ROBOT, RecognitionConfig(), StepClock("loop"), "session")
        self.questions: list[Question] = []
        self.said: list[Saying] = []
        self.events: list[ConnectionEvent] = []
        self.perceived = 0
        """Messages of perception."""
        self.messages: list[Message] = []
        """These, if somebody wants them."""
        self.now = 0.0
        self._tracker = OngoingActionTracker()
        self._robot = self._asks()
        self._next = next(self._robot)
        self._take(keys.WORLD, world(*self.party.people))
        self._perceive(*(ActorFound(actor=each, at=stamp(0.0)) for each in self.party.people))
        self.party.begin(0.0)

    def until(self, end: float) -> None:
        """Play until then."""
        while True:
            due = [at for at in (self.party.deadline, self.intake.deadline, self._next[0]) if at is not None]
            if (now := min(due)) > end:
                return
            self.now = max(self.now, now)
            self._note(self.intake.advance(self.now))
            if self._next[0] <= self.now:
                for key, message in self._next[1]:
                    self._take(key, message)
                    self.party.feed(message, self.now)
                self._next = next(self._robot)
            self._perceive(*self.party.advance(self.now, stamp(self.now)))
            self.said += self.party.said
            self.party.said.clear()

    def _perceive(self, *told: ActionBegan | ActionEnded | ActorFound | Utterance | Message) -> None:
        for message in told:
            self.perceived += 1
            self.messages.append(message)
            self._take(keys.UTTERANCE if isinstance(message, Utterance) else keys.PERCEIVED_ACTION, message)
            for state in self._tracker.feed((message,), stamp(self.now)):
                assert isinstance(state, OngoingActions)
                self._take(keys.perceived_ongoing("simulation", state.actor), state)

    def _take(self, key: str, message: Message) -> None:
        if reads(message):
            source = "control" if "control" in key or "robot" in key else "simulation"
            self._note(self.intake.take(Input(key, message, source, self.now), self.now))

    def _note(self, outputs: object) -> None:
        for each in outputs if isinstance(outputs, list) else ():
            if isinstance(each, PublishMessage) and isinstance(each.message, ConnectionEvent):
                self.events.append(each.message)

    def _asks(self) -> Iterator[tuple[float, list[tuple[str, Message]]]]:
        """What the robot does: it looks at somebody, and asks; the answer counts or not."""
        at, number = 0.0, 0
        while True:
            at += self.chance.uniform(*EVERY)
            number += 1
            to, block = self.chance.choice(self.party.people), f"block-{number}"
            words = f"{to.title()}, do you like the {self.chance.choice(('red', 'blue'))} one?".split()
            end = at + 0.4 * len(words)
            self.questions.append(Question(to, at + 0.3, end + 0.3))
            look = ActionBegan(actor=ROBOT, action="look", at=stamp(at), targets=(to,), behavior=f"{block}:look")
            yield at, [(keys.ROBOT_ACTION, look)]
            began = replace(look, action="speak", targets=(), behavior=f"{block}:speech", at=stamp(at + 0.3))
            asked: RequestEvent = request_event(
                "adjacency_pair", at + 0.3, request=block, block=block, turn=block, responder=to
            )
            yield at + 0.3, [(keys.EVENT, asked), (keys.ROBOT_ACTION, began)]
            for place, word in enumerate(words):
                heard = WordSpoken(block=block, behavior="speech", word=word, position=place, at=stamp(at))
                yield at + 0.3 + 0.4 * place, [(keys.SYNC_POINT, heard)]
            ended = ActionEnded(actor=ROBOT, action="speak", at=stamp(end + 0.3), behavior=began.behavior)
            signal = TurnSignal(id="e", turn=block, signal="ended", actor=to)
            over = SignalTurn(id=f"{block}/e", requester="realizer", signal=signal, at=stamp(end + 0.3), block=block)
            done = BlockProgress(block=block, progress="end", at=stamp(end + 0.3), status="done")
            yield (
                end + 0.3,
                [
                    (keys.ROBOT_ACTION, ended), (keys.TURN, over), (keys.FEEDBACK, done),
                ],
            )  # fmt: skip
            at = end + 0.3
