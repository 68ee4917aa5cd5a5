"""Operations of the door: each is one method of `Robot`, with its path, what it takes and gives, and who may ask it.

Who may, and how large a body may be, is not decided here: each operation names the key of the bus that it comes to,
and the table of access (schemas/access.py) has the roles and the bytes of that key.
"""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, Literal, NamedTuple

import msgspec
from msgspec import Struct, structs

from engage_hri.schemas import access, keys
from engage_hri.schemas.access import OWN, Does
from engage_hri.schemas.blocks import BehaviorInterrupted, Block, BlockOutcome
from engage_hri.schemas.body import Capabilities
from engage_hri.schemas.body_faults import BodyFault, BodyFaults
from engage_hri.schemas.faults import Fault, InputRefused, raised_as
from engage_hri.schemas.fragments import FragmentOutcome, HeadOwner, StudyCondition, TurnFragment
from engage_hri.schemas.recognition import Floor, Statistics
from engage_hri.schemas.summary import Summary, summary
from engage_hri.schemas.tool import ToolInput
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.client.feeds import Feed, first_of
from engage_hri.services.client.robot import Robot

Call = Callable[[Robot, bytes, Any], Coroutine[Any, Any, Struct]]
LONGEST_INHIBITION: Seconds = 600.0
"""A request is open for so long."""


class StateQuery(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Query of a question. timeout: seconds to wait for who knows it."""

    timeout: Seconds = 1.0


class PersonQuery(StateQuery, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The same about a person. actor: their id; `all`: all people together."""

    actor: str = "all"


class PerformQuery(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Query of what is performed. timeout: seconds to wait until it is accepted: the robot may not be there yet."""

    timeout: Seconds = 10.0


class TurnQuery(PerformQuery, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The same of a turn. await_answer: 1: tell of it when it has been answered, or it is too late."""

    await_answer: bool = False


class Steered(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Part of what the robot performs. block: id of a fragment or block. behavior: of it; empty: all of it."""

    block: str
    behavior: str = ""


class SteeredBlocks(Struct, frozen=True, kw_only=True, tag="steered"):
    """Answer to what was held, goes on or has been stopped. blocks: their ids."""

    blocks: tuple[str, ...]


class Inhibited(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Wish to keep the gaze (or an arm) from what fragments want, for so many seconds, as `Robot.inhibit_gaze`."""

    seconds: Seconds
    mode: Literal["release", "hold", "target"] = "hold"
    target: str = ""
    part: Literal["gaze", "point-left", "point-right"] = "gaze"


class InhibitionOver(Struct, frozen=True, kw_only=True, tag="inhibition_over"):
    """Answer when the time is over."""


class ConditionWanted(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A condition of a study that begins, as `Robot.set_condition` has it."""

    name: str = ""
    speech_only: bool = False
    by: str = ""


class FaultsOn(Struct, frozen=True, kw_only=True, tag="faults_on"):
    """Faults that a simulated body plays."""

    faults: tuple[BodyFault, ...] = ()


class Right(NamedTuple):
    """Right on the bus that something takes. does: what is done with the key."""

    does: Does
    key: str

    def has(self, role: str) -> bool:
        """Tell whether participants of this role may do so."""
        key = keys.command(self.key, role, OWN) if self.does == "publishes" else self.key
        return key in access.rows(role, self.does)

    @property
    def most(self) -> int:
        """Bytes that are taken."""
        return access.most(keys.command(self.key, "any", "any") if self.does == "publishes" else self.key)


class Operation(NamedTuple):
    """Request that can be made. title: what it does. query, body, gives: structs of its parameters and its answer.

    is_document: the body may be a document in XML as well. call: what is done, with the body and the query.
    """

    method: Literal["GET", "POST", "PUT"]
    path: str
    title: str
    right: Right
    call: Call
    gives: type[Struct]
    query: type[Struct] = PerformQuery
    body: type[Struct] | None = None
    is_document: bool = False


def decoded(kind: type[Struct], body: bytes) -> Any:
    """Read the body of a request. Raises InputRefused with the JSON path."""
    with raised_as(
        InputRefused,
        (msgspec.DecodeError, UnicodeDecodeError, RecursionError),
        "body",
        advice="the form is in /v1/openapi.json",
    ):
        return msgspec.json.decode(body, type=kind)


def queried(kind: type[Struct], given: dict[str, str]) -> Any:
    """Read the parameters of an address. Raises InputRefused."""
    takes = ", ".join(each.name for each in structs.fields(kind))
    advice = f"parameters: {takes}" if takes else "it has no parameters"
    with raised_as(InputRefused, msgspec.ValidationError, "address", advice=advice):
        return msgspec.convert(given, kind, strict=False)


async def _turn(robot: Robot, body: bytes, query: TurnQuery) -> Summary:
    return summary(await robot.perform(body, await_answer=query.await_answer, timeout=query.timeout))


async def _fragment(robot: Robot, body: bytes, query: TurnQuery) -> FragmentOutcome:
    return await robot.perform(body, await_answer=query.await_answer, timeout=query.timeout)


async def _block(robot: Robot, body: bytes, query: PerformQuery) -> BlockOutcome:
    return await robot.realize(body, timeout=query.timeout)


async def _interrupt(robot: Robot, body: bytes, query: PerformQuery) -> BehaviorInterrupted:
    meant = decoded(Steered, body)
    return await robot.interrupt(meant.block, meant.behavior, timeout=query.timeout)


async def _inhibit(robot: Robot, body: bytes, query: PerformQuery) -> InhibitionOver:
    wish: Inhibited = decoded(Inhibited, body)
    if not 0 < wish.seconds <= LONGEST_INHIBITION:
        raise InputRefused(Fault(reason=f"not within 0 and {LONGEST_INHIBITION:g} s", where="$.seconds"))
    async with robot.inhibit_gaze(wish.mode, target=wish.target, part=wish.part, timeout=query.timeout):
        await asyncio.sleep(wish.seconds)
    return InhibitionOver()


async def _set_condition(robot: Robot, body: bytes, query: PerformQuery) -> StudyCondition:
    wish: ConditionWanted = decoded(ConditionWanted, body)
    with robot.conditions() as conditions:
        await robot.set_condition(wish.name, speech_only=wish.speech_only, by=wish.by, timeout=query.timeout)
        while (told := await conditions.next(query.timeout)) is not None and told.name != wish.name:
            pass
    return told or await robot.condition(query.timeout)


async def _switch_faults(robot: Robot, body: bytes, query: PerformQuery) -> FaultsOn:
    wish: FaultsOn = decoded(FaultsOn, body)
    return FaultsOn(faults=await robot.switch_faults(wish.faults, timeout=query.timeout))


async def _capabilities(robot: Robot, body: bytes, query: StateQuery) -> Capabilities:
    return await robot.capabilities(query.timeout)


def _steers(to: Literal["hold", "resume", "stop"]) -> Call:
    async def steer(robot: Robot, body: bytes, query: PerformQuery) -> SteeredBlocks:
        meant = decoded(Steered, body)
        return SteeredBlocks(blocks=await getattr(robot, to)(meant.block, meant.behavior, timeout=query.timeout))

    return steer


def _steers_all(to: Literal["hold", "resume", "stop"]) -> Call:
    async def steer(robot: Robot, body: bytes, query: PerformQuery) -> SteeredBlocks:
        return SteeredBlocks(blocks=await getattr(robot, to)(timeout=query.timeout))

    return steer


def _tells(
    what: str, feed: Callable[[Robot], Feed[Any]], told: Callable[[Any], Struct] = lambda state: state
) -> Call:
    async def tell(robot: Robot, body: bytes, query: StateQuery) -> Struct:
        return told(await first_of(feed(robot), what, query.timeout))

    return tell


async def _person(robot: Robot, body: bytes, query: StateQuery) -> Entity:
    return await robot.person(query.timeout)


async def _statistics(robot: Robot, body: bytes, query: PersonQuery) -> Statistics:
    return await robot.statistics(query.actor, query.timeout)


def _faults_of(state: BodyFaults) -> FaultsOn:
    return FaultsOn(faults=state.faults)


_SPEAKS, _REALIZES = Right("publishes", keys.FRAGMENT), Right("publishes", keys.BLOCK)
_STEERS = Right("publishes", keys.ROBOT)
_KNOWS_WORLD = Right("subscribes", keys.WORLD)
STEERING: tuple[tuple[Literal["hold", "resume", "stop"], str], ...] = (
    ("hold", "Hold {} until it is resumed."),
    ("resume", "Let {} go on from where it is."),
    ("stop", "End {}, safely."),
)

OPERATIONS = (
    Operation(
        "POST", "/v1/turn", "Speak a turn, as the tool of language models has it; returns when it is over.", _SPEAKS,
        _turn, Summary, TurnQuery, ToolInput,
    ),
    Operation(
        "POST", "/v1/fragment", "Perform a turn fragment, in JSON or EBML; returns when it is over.", _SPEAKS,
        _fragment, FragmentOutcome, TurnQuery, TurnFragment, is_document=True,
    ),
    Operation(
        "POST", "/v1/block", "Realize a BML block, in JSON or BML; returns when it is over.", _REALIZES,
        _block, BlockOutcome, PerformQuery, Block, is_document=True,
    ),
    Operation(
        "POST", "/v1/interrupt", "End one behavior of a block, which goes on without it.", _REALIZES,
        _interrupt, BehaviorInterrupted, body=Steered,
    ),
    *(
        Operation("POST", f"/v1/block/{to}", title.format("a fragment or block, or a behavior of it"), _REALIZES,
                  _steers(to), SteeredBlocks, body=Steered)
        for to, title in STEERING
    ),
    *(
        Operation("POST", f"/v1/robot/{to}", title.format("all that the robot performs"), _STEERS,
                  _steers_all(to), SteeredBlocks)
        for to, title in STEERING
    ),
    Operation(
        "POST", "/v1/inhibit", "Keep the gaze or an arm from what fragments want; returns when the time is over.",
        Right("publishes", keys.INHIBIT), _inhibit, InhibitionOver, body=Inhibited,
    ),
    Operation("GET", "/v1/world", "Tell what is perceived now.", _KNOWS_WORLD,
              _tells("world", Robot.worlds), World, StateQuery),
    Operation("GET", "/v1/person", "Tell who is there, or the first to come.", _KNOWS_WORLD,
              _person, Entity, StateQuery),
    Operation("GET", "/v1/floor", "Tell who speaks, and to whom.", Right("subscribes", keys.FLOOR),
              _tells("floor", Robot.floor), Floor, StateQuery),
    Operation("GET", "/v1/statistics", "Tell statistics and engagement of a person, or of all.",
              Right("subscribes", keys.ANY_STATISTICS), _statistics, Statistics, PersonQuery),
    Operation("GET", "/v1/head", "Tell what owns the robot's head, and why.", Right("subscribes", keys.HEAD_OWNER),
              _tells("owner of the head", Robot.head_owners), HeadOwner, StateQuery),
    Operation("GET", "/v1/capabilities", "Tell what the body says of itself.", Right("asks", keys.DESCRIBE),
              _capabilities, Capabilities, StateQuery),
    Operation("GET", "/v1/condition", "Tell the condition of a study.", Right("subscribes", keys.STUDY_CONDITION),
              _tells("condition of a study", Robot.conditions), StudyCondition, StateQuery),
    Operation("PUT", "/v1/condition", "Begin a condition of a study.", Right("publishes", keys.CONDITION),
              _set_condition, StudyCondition, body=ConditionWanted),
    Operation("GET", "/v1/faults", "Tell the faults that a simulated body plays.",
              Right("subscribes", keys.BODY_FAULTS), _tells("state of the body", Robot.body_faults, _faults_of),
              FaultsOn, StateQuery),
    Operation("PUT", "/v1/faults", "Switch on exactly these faults of a simulated body.",
              Right("publishes", keys.FAULTS), _switch_faults, FaultsOn, body=FaultsOn),
)  # fmt: skip
"""All of them, but for the two that go on: news, and turns that are written bit by bit."""


class Topic(NamedTuple):
    """News of one kind. feed: what tells them."""

    right: Right
    feed: Callable[[Robot], Feed[Any]]


TOPICS: dict[str, Topic] = {
    "connection_events": Topic(
        Right("subscribes", keys.ANY_CONNECTION_EVENT), lambda robot: robot.connection_events(open=True)
    ),
    "utterances": Topic(Right("subscribes", keys.UTTERANCE), Robot.utterances),
    "words": Topic(Right("subscribes", keys.SYNC_POINT), Robot.words),
    "turns": Topic(Right("subscribes", keys.TURN_CLOSED), Robot.turns),
    "floor": Topic(Right("subscribes", keys.FLOOR), Robot.floor),
    "interjections": Topic(Right("subscribes", keys.ANY_INTERJECTION), Robot.interjections),
    "engagement": Topic(Right("subscribes", keys.ANY_STATISTICS), Robot.engagement),
    "actions": Topic(Right("subscribes", keys.ANY_ACTION), Robot.actions),
    "head": Topic(Right("subscribes", keys.HEAD_OWNER), Robot.head_owners),
    "holds": Topic(Right("subscribes", keys.HELD), Robot.holds),
    "conditions": Topic(Right("subscribes", keys.STUDY_CONDITION), Robot.conditions),
    "feedback": Topic(Right("subscribes", keys.ANY_FEEDBACK), Robot.feedback),
    "faults": Topic(Right("subscribes", keys.ANY_FAULT), Robot.faults),
    "worlds": Topic(_KNOWS_WORLD, Robot.worlds),
}
"""News by topic, each a feed of `Robot`."""
SPEAKS = _SPEAKS
"""What a turn that is written bit by bit comes to."""


def topics(only: str) -> tuple[str, ...]:
    """Read the topics of a link. only: with commas between; empty: all. Raises InputRefused."""
    wanted = tuple(dict.fromkeys(filter(None, only.split(",")))) or tuple(TOPICS)
    for each in wanted:
        if each not in TOPICS:
            advice = f"topics: {', '.join(TOPICS)}"
            raise InputRefused(Fault(reason=f"there is no topic {each!r:.80}", where="only", advice=advice))
    return wanted
