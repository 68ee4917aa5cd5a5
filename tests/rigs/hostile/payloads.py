"""Messages as payloads for keys: in both encodings, on the right key, a wrong one or none, some with broken bytes."""

from collections.abc import Mapping
from typing import NamedTuple

import msgspec

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import (
    BehaviorInterrupted,
    BlockOutcome,
    BlockProgress,
    BodyHeld,
    Held,
    NetMarked,
    NetPlanned,
    NetWaiting,
    PerformanceSteered,
    PredictionFeedback,
    SyncPointProgress,
    WarningFeedback,
)
from engage_hri.schemas.body import RobotSeen, RobotState, SyncPointArrived, SyncPointReached, WordSpoken
from engage_hri.schemas.body_faults import BodyFaults, FaultsSwitched
from engage_hri.schemas.fragments import (
    ConditionSet,
    FragmentOutcome,
    HeadOwner,
    InhibitionEnded,
    StudyCondition,
    TurnClosed,
)
from engage_hri.schemas.messages import COMMANDS, MAJOR, Message
from engage_hri.schemas.participants import ServiceSettings
from engage_hri.schemas.perception import (
    ActionBegan,
    ActionEnded,
    ActorFound,
    ActorLost,
    HeadPose,
    Looked,
    OngoingActions,
    SoundFrame,
    Utterance,
    VoiceActivity,
)
from engage_hri.schemas.recognition import ConnectionEvent, EventOutcome, OpenEvents, Statistics, TurnOutcome
from engage_hri.schemas.requests import Cancel, KeepAlive, Request
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from tests.rigs.hostile.chance import Chance, happens
from tests.rigs.hostile.markup import document
from tests.rigs.hostile.typed import SURROGATE, RandomMessages, distorted

BROKEN = 0.05
"""Share of the payloads that have bits flipped, or end early."""
DISTORTED = 0.15
MARKUP = 0.05

SERVER: Mapping[type, str] = {
    FragmentOutcome: "generation", InhibitionEnded: "generation", BlockOutcome: "realizer",
    BehaviorInterrupted: "realizer", PerformanceSteered: "realizer",
    EventOutcome: "recognition", TurnOutcome: "recognition", FaultsSwitched: "control",
    ConditionSet: "generation",
}  # fmt: skip
FIXED_KEYS: Mapping[type, str] = {
    **dict.fromkeys((BlockProgress, SyncPointProgress, PredictionFeedback, WarningFeedback), keys.FEEDBACK),
    **dict.fromkeys((SyncPointArrived, SyncPointReached, WordSpoken), keys.SYNC_POINT),
    **dict.fromkeys((ActorFound, ActorLost), keys.PERCEIVED_ACTION),
    TurnClosed: keys.TURN_CLOSED, World: keys.WORLD, HeadOwner: keys.HEAD_OWNER, RobotState: keys.ROBOT_STATE,
    NetPlanned: keys.NET, NetMarked: keys.NET, NetWaiting: keys.NET, Held: keys.HELD,
    BodyHeld: keys.BODY_HELD, BodyFaults: keys.BODY_FAULTS, RobotSeen: keys.ROBOT_SEEN, Utterance: keys.UTTERANCE,
    StudyCondition: keys.STUDY_CONDITION,
}  # fmt: skip
"""Key of each type of message that always has the same."""


class Payload(NamedTuple):
    """Bytes that another program puts on the bus. kind: type of the message that they were made from."""

    key: str
    data: bytes
    encoding: str
    kind: str


class Payloads:
    """Makes payloads without end. entities: ids of what the world holds, for markup."""

    def __init__(self, chance: Chance, messages: RandomMessages, entities: tuple[str, ...]) -> None:
        self._chance = chance
        self._messages = messages
        self._entities = entities

    def next(self, now: Seconds) -> Payload:
        if happens(self._chance, MARKUP):
            key = self._command(self._chance.choice((keys.BLOCK, keys.FRAGMENT)))
            return Payload(key, document(self._chance, self._entities), "application/xml", "markup")
        message = self._messages.message(now)
        form = self._chance.choice(("msgpack", "json"))
        data = self._encoded(message, form)
        if happens(self._chance, BROKEN):
            data = broken(self._chance, data)
        name = type(message).__name__
        return Payload(self._key(message), data, self._encoding(form, name), name)

    def _encoded(self, message: Message, form: str) -> bytes:
        thing = distorted(self._chance, message) if happens(self._chance, DISTORTED) else message
        encode = msgspec.json.encode if form == "json" else msgspec.msgpack.encode
        try:
            data = encode(thing)
        except (OverflowError, ValueError):  # an integer that no MessagePack holds
            data = encode(message)
        # Half a surrogate pair takes three bytes, as many as the character that stands for it.
        return data.replace(SURROGATE.encode(), b"\xed\xa0\x80")

    def _encoding(self, form: str, name: str) -> str:
        if happens(self._chance, 0.03):
            form, name = self._chance.choice((("json", name), ("msgpack", name), ("octet-stream", name), ("", "")))
        version = self._chance.choice((MAJOR + 1, "x", "")) if happens(self._chance, 0.02) else MAJOR
        return f"application/{form}" if happens(self._chance, 0.3) else f"application/{form};engage.{name}/{version}"

    # -- keys -----------------------------------------------------------------------------------------------------

    def _key(self, message: Message) -> str:
        where = self._chance.random()
        if where < 0.85:
            return self.right_key(message)
        if where < 0.95:
            return self.right_key(self._messages.message(0.0))
        server = self._chance.choice((*keys.SERVICES, "nobody"))
        kind = self._chance.choice(("cmd", "evt", "state", "stream", "rpc"))
        tail = self._chance.choice(
            ("", "/block", "/a/b", "/manager/mallory/block/more", "/manager//block", "/*/*/block")
        )
        return f"{keys.PREFIX}/{kind}/{server}{tail}"

    def right_key(self, message: Message) -> str:
        """Key on which this message belongs; one that any server may get goes to a random one."""
        server = SERVER.get(type(message)) or self._chance.choice(keys.SERVICES)
        match message:
            case KeepAlive():
                return self._command(keys.keep_alive(server))
            case Cancel():
                return self._command(keys.cancel(server))
            case Request():
                return self._command(next(key for key, kinds in COMMANDS.items() if isinstance(message, kinds)))
            case ActionBegan() | ActionEnded():
                return self._chance.choice((keys.PERCEIVED_ACTION, keys.ROBOT_ACTION, keys.RECOGNIZED_ACTION))
            case OngoingActions(actor=actor):
                perceived = keys.perceived_ongoing("stranger", _chunk(actor))
                return self._chance.choice((perceived, keys.ROBOT_ONGOING))
            case HeadPose(actor=actor):
                return keys.head_pose(_chunk(actor))
            case Looked():
                return keys.looked("eyes")
            case VoiceActivity(actor=actor):
                return keys.voice_activity(_chunk(actor))
            case SoundFrame():
                return self._chance.choice((keys.ROBOT_SOUND, keys.sound("stranger")))
            case ConnectionEvent(kind=kind):
                return keys.connection_event("person", kind)
            case OpenEvents(actor=actor):
                return keys.open_events(_chunk(actor))
            case Statistics(actor=actor):
                return keys.statistics(_chunk(actor))
            case ServiceSettings(participant=name):
                return keys.settings(_chunk(name))
        return FIXED_KEYS.get(type(message)) or keys.request_state(server)

    def _command(self, expression: str) -> str:
        role = self._chance.choice(("manager", "observer", "realizer"))
        requester = self._chance.choice(("stranger", "mallory", "realizer", "visitor", "x" * 200))
        return keys.command(expression, role, requester)


def _chunk(actor: str) -> str:
    return actor if keys.is_chunk(actor) else "person"


def broken(chance: Chance, data: bytes) -> bytes:
    """Flip a few bits of the data, or cut off its end."""
    if len(data) < 2:
        return data
    if happens(chance, 0.3):
        return data[: chance.randrange(0, len(data))]
    changed = bytearray(data)
    for _ in range(chance.randrange(1, 4)):
        changed[chance.randrange(0, len(data))] ^= 1 << chance.randrange(0, 8)
    return bytes(changed)
