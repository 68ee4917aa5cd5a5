"""A short scene as messages, for the tests of what shows it."""

from collections.abc import Callable, Iterable
from typing import TypeVar

from engage_hri.schemas.blocks import BlockProgress, PlannedPoint, PredictionFeedback, SyncPointProgress
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.fragments import Claim, HeadOwner
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.recognition import ConnectionEvent, Statistics, WindowStatistics
from engage_hri.schemas.units import Seconds, Stamp

Timed = tuple[Message, Seconds]


def at(seconds: Seconds) -> Stamp:
    return Stamp("loop", seconds)


def event(id: str, state: str, time: Seconds, **fields: object) -> Timed:
    values: dict[str, object] = {
        "kind": "directed_gaze", "initiator": "robot", "responder": "human", "objects": ("rectangle",),
        "cause": "reference", "started": at(time), **fields,
    }  # fmt: skip
    return ConnectionEvent(id=id, state=state, at=at(time), **values), time  # type: ignore[arg-type]


SCENE: tuple[Timed, ...] = (
    (ActionBegan(actor="human", action="look", at=at(10.0), targets=("robot",)), 10.0),
    (BlockProgress(block="b", progress="start", at=at(10.0)), 10.0),
    (
        PredictionFeedback(
            block="b",
            points=(
                PlannedPoint(behavior="s", sync="start", time=0.5),
                PlannedPoint(behavior="s", sync="end", time=2.0),
            ),
        ),
        10.0,
    ),
    (HeadOwner(owner=Claim(kind="fragment", priority=2, target="rectangle"), since=at(10.1)), 10.1),
    (ActionBegan(actor="robot", action="look", at=at(10.3), targets=("rectangle",), behavior="b:g"), 10.3),
    (SyncPointProgress(block="b", behavior="s", sync="start", at=at(10.6), time=0.6, predicted=0.5), 10.6),
    (ActionBegan(actor="robot", action="speak", at=at(10.6), behavior="b:s"), 10.6),
    (WordSpoken(block="b", behavior="s", word="a", position=1, at=at(11.0)), 11.0),
    event("e1", "started", 11.0),
    (WordSpoken(block="b", behavior="s", word="rectangle", position=11, at=at(11.8)), 11.8),
    event("e1", "succeeded", 11.9, started=at(11.0), delay=0.9),
    (ActionEnded(actor="robot", action="speak", at=at(12.0), behavior="b:s"), 12.0),
    (Statistics(actor="", at=at(12.0), session=WindowStatistics(mtbce=4.2), recent=WindowStatistics()), 12.0),
)  # fmt: skip


S = TypeVar("S")


def fed(feed: Callable[[S, Message, Seconds], S], state: S, messages: Iterable[Timed] = SCENE) -> S:
    for message, time in messages:
        state = feed(state, message, time)
    return state
