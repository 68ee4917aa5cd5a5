"""People who pass by, one after the other, each with a number of its own, as face trackers give them."""

from collections.abc import Iterator

from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, HeadPose, VoiceActivity
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.machine import PersonForgotten
from engage_hri.services.recognition.events.open_events import OpenEventTracker
from engage_hri.services.recognition.recognizer import Perceived, Recognizer, Result
from engage_hri.services.recognition.statistics.published import PublishedStatistics
from engage_hri.services.reports.action_reports import REPORT_GRACE, ActionReports
from engage_hri.services.reports.ongoing_actions import ActionEvent, OngoingActionTracker
from tests.recognition.observations import PIECES, ROBOT, stamp, world
from tests.recognition.raw import EYES

EVERY: Seconds = 8.0
"""Between two visits."""


class Lobby:
    """All of recognition but the bus, driven as the service does."""

    def __init__(self, config: RecognitionConfig) -> None:
        self.events: list[ConnectionEvent] = []
        self.keeps_events = False
        self.tracker = OngoingActionTracker()
        self.recognizer = Recognizer(ROBOT, config)
        self.published = PublishedStatistics(ROBOT, config)
        self.book = OpenEventTracker(ROBOT, "session")
        self.reporters = ActionReports(ROBOT, REPORT_GRACE, "loop", lambda stamp: stamp.seconds)
        self.feed(world("host"), 0.0)

    def feed(self, observation: Perceived, at: Seconds) -> None:
        while (due := self._deadline) is not None and due < at:
            self._tell(self.recognizer.advance(due), due)
        if not isinstance(observation, ActionEvent):
            self._tell(self.recognizer.feed(observation, at, at), at)
            return
        for said in (observation, *self.tracker.feed([observation], stamp(at))):
            for told in self.reporters.hear(said, "cameras", "", at):
                self._tell(self.recognizer.feed(told.observation, told.at, at), at)
        self.tracker.forget(at)

    @property
    def _deadline(self) -> Seconds | None:
        times = (self.recognizer.deadline, self.published.deadline)
        return min((at for at in times if at is not None), default=None)

    def _tell(self, results: list[Result], now: Seconds) -> None:
        changes = [result for result in results if isinstance(result, ConnectionEvent | PersonForgotten)]
        events = [change for change in changes if isinstance(change, ConnectionEvent)]
        for change in changes:
            if isinstance(change, PersonForgotten):
                self.reporters.forget(change.actor)
        self.book.feed(events, stamp(now))
        self.published.feed(changes, self.recognizer.session.busy, now, self.recognizer.contacts())
        self.published.told(now)
        if self.keeps_events:
            self.events += events

    def kept(self) -> tuple[object, ...]:
        return self.recognizer, self.published, self.book, self.reporters


def visit(number: int, *, raw: bool) -> Iterator[tuple[Seconds, Perceived]]:
    """Of track-<number>: it comes, looks at the robot's face and at a piece, says something and goes."""
    actor, since = f"track-{number}", EVERY * number + 1.0
    if raw:
        yield from _filmed(actor, since)
        return
    piece = PIECES[number % len(PIECES)]
    yield since, ActorFound(actor=actor, at=stamp(since))
    for after, kind, action, target in (
        (0.2, ActionBegan, "look", ROBOT), (0.6, ActionBegan, "speak", ""), (1.9, ActionEnded, "speak", ""),
        (2.2, ActionBegan, "look", piece), (2.9, ActionBegan, "act", piece), (4.0, ActionEnded, "act", piece),
    ):  # fmt: skip
        at, targets = since + after, (target,) if target else ()
        yield at, kind(actor=actor, action=action, at=stamp(at), targets=targets)  # type: ignore[arg-type]
    yield since + 2.6, ActionBegan(actor=ROBOT, action="look", at=stamp(since + 2.6), targets=(actor,))
    yield since + 4.5, ActorLost(actor=actor, at=stamp(since + 4.5))


def _filmed(actor: str, since: Seconds) -> Iterator[tuple[Seconds, Perceived]]:
    """By a camera of ten frames a second, which sees a hand, too; and heard."""
    things = tuple(Entity(id=piece, kind="object", position=(0.5, 0.0, 0.7)) for piece in PIECES)
    for frame in range(20):
        at = since + 0.1 * frame
        hand = Entity(id=f"{actor}-hand", kind="hand", owner=actor, position=(0.6, 0.01 * frame, 0.7))
        yield at, HeadPose(actor=actor, position=EYES, direction=(-1.25, 0.0, -0.03), at=stamp(at))
        yield at, VoiceActivity(actor=actor, active=5 < frame < 15, at=stamp(at))
        if frame % 5 == 0:
            face = Entity(id=actor, kind="person", position=EYES)
            yield at, World(entities=(*things, face, hand), at=stamp(at))
    yield since + 2.0, World(entities=things, at=stamp(since + 2.0))
