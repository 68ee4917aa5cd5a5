"""Table of access: who publishes, subscribes to, serves and asks what, and how large and how frequent that may be.

`engage keys acl` makes the rules from it. The limits hold without keys as well: a bus refuses at the sender what is
larger, and Zenoh drops it where it comes in (services/bus/zenoh/rules.py). Each is eight times or more the largest
message that was measured on its key with a thousand behaviors in a block, a thousand objects in a world, and the
tangram task.

A certificate belongs to a holder: a role at a robot, with a name. All that a process does has to be in a row of its
role. What is in no row is denied. `{own}` in a key stands for the holder's name; a process of this holder calls its
participants so too, or by this name with `-` and more behind it.
"""

from collections.abc import Iterator
from functools import lru_cache
from hashlib import sha256
from typing import Literal, NamedTuple

from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused

SMALL = 64 * 1024
"""Bytes of most messages; the largest measured has 6 kB."""
MEDIUM = 1024 * 1024
"""Bytes of blocks, of what is told of a whole block, of worlds, and of lists of people or requests."""
LARGEST = 4 * 1024 * 1024
"""Bytes of the largest messages, and of a document in a file, in whatever form."""
LARGEST_XML_SENT = 64 * 1024
"""Bytes of XML that is sent over the bus, some 700 behaviors. A kilobyte takes up to 1 ms to read; a server does
nothing else meanwhile, and the realizer has to renew what the body does. JSON and MessagePack take a hundredth."""
LARGER: dict[str, int] = {
    keys.NET: LARGEST, keys.FEEDBACK: LARGEST,
    keys.FRAGMENT: MEDIUM, keys.BLOCK: MEDIUM, keys.BEHAVIOR: MEDIUM, f"{keys.PREFIX}/cmd/*/*/*/keep_alive": MEDIUM,
    keys.ANY_REQUEST_STATE: MEDIUM, keys.FRAGMENT_FEEDBACK: MEDIUM, keys.ANY_TAKEN: MEDIUM, keys.WORLD: MEDIUM,
    keys.ROBOT_STATE: MEDIUM, keys.ROBOT_SEEN: MEDIUM, keys.ROBOT_ONGOING: MEDIUM, keys.ANY_OPEN_EVENTS: MEDIUM,
    keys.ANY_STATISTICS: MEDIUM, keys.ESTIMATE: MEDIUM, keys.DESCRIBE: MEDIUM, keys.status("*"): MEDIUM,
    keys.own("*", "past"): MEDIUM, keys.own("*", "counts"): MEDIUM,
}  # fmt: skip
"""Bytes of a message, and of a question or an answer, on keys that take more than `SMALL`."""
LOUD = {"observer": 256 * 1024, "operator": 256 * 1024, "manager": MEDIUM, "wizard": 2 * MEDIUM}
"""Bytes a second from which on a router tells that a holder of this role is loud. A manager who asks for 10,000
fragments at once sends some 0.4 MB a second."""
LOUD_ROBOT = 16 * 1024 * 1024
"""The same for all others. A service hands out that much when it is asked for its past."""
MOST_PULSES = 20
"""Pulses of one process that a router passes on in a second. A process of ours sends one or two."""
LONGEST_KEY = 2048
"""Bytes of a key: it may have two ids of 250 characters. Zenoh stops the link of one who sends 65 536 of them."""
LONGEST_ENCODING = 255
"""Bytes of the name of an encoding. More stop the sender's link in Zenoh."""
BESIDE = 8 * 1024
"""Bytes that a message has besides its payload: its attachment, or what a process adds that hands out the past."""


@lru_cache(4096)  # asked for every message
def most(key: str) -> int:
    """Bytes that the payload of a message on this key may have, and of a question or an answer."""
    return next((size for pattern, size in LARGER.items() if keys.matches(pattern, key)), SMALL)


def check_size(key: str, payload: bytes, encoding: str) -> None:
    """Raise InputRefused for what is too large to be sent, or to be read, on this key."""
    if len(payload) > (limit := most(key)):
        advice = "split it into several"
        raise InputRefused(
            Fault(reason=f"{len(payload)} bytes; at most {limit} may be sent", where=key, advice=advice)
        )
    if (length := len(encoding.encode())) > LONGEST_ENCODING:
        reason = f"the name of an encoding has {length} bytes; at most {LONGEST_ENCODING} may be sent"
        raise InputRefused(Fault(reason=reason, where=key, advice="application/msgpack or application/json"))
    if (length := len(key.encode())) > LONGEST_KEY:
        reason = f"a key of {length} bytes; at most {LONGEST_KEY} may be sent"
        raise InputRefused(Fault(reason=reason, where=f"{key[:80]}...", advice="use shorter names and ids"))


Does = Literal["publishes", "subscribes", "serves", "asks"]
OWN = "{own}"
ROUTER = "router"
"""Role of a router. It is no participant: it passes everything on, to the other routers too."""


class Holder(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The one to whom a certificate was given."""

    robot: str
    role: str
    name: str

    @property
    def common_name(self) -> str:
        """Common name of its certificate, by which the rules know it."""
        return f"{self.robot}/{self.role}/{self.name}"

    @property
    def mark(self) -> str:
        """Beginning of the ids of all its processes: the rules grant the bus' own keys of these ids only."""
        return f"{_role_mark(self.role)}{_name_mark(self.name)}"

    def called(self, name: str) -> str:
        """Name of a participant in one of its processes: `name`, behind the holder's own if it is not that."""
        return name if name == self.name or name.startswith(f"{self.name}-") else f"{self.name}-{name}"


class Row(NamedTuple):
    """A row of the table. why: the reason for a row that no program of ours needs yet."""

    role: str
    does: Does
    key: str
    why: str = ""

    @property
    def most(self) -> int:
        """Bytes of a message, question or answer of this row, without what stands beside the payload."""
        return most(owned(self.key, OWN[1:-1]))


SERVED = {
    "fragment": keys.FRAGMENT, "inhibit": keys.INHIBIT, "block": keys.BLOCK, "event": keys.EVENT, "turn": keys.TURN,
    "behavior": keys.BEHAVIOR, "robot": keys.ROBOT, "faults": keys.FAULTS, "condition": keys.CONDITION,
}  # fmt: skip
"""Commands by their subject."""
WATCHED = (
    keys.ANY_REQUEST_STATE, keys.ANY_FEEDBACK, keys.SYNC_POINT, keys.ANY_ACTION, keys.UTTERANCE,
    keys.ANY_CONNECTION_EVENT, keys.ANY_FAULT, keys.HEAD_OWNER, keys.HELD, keys.BODY_HELD, keys.BODY_FAULTS,
    keys.STUDY_CONDITION, keys.ANY_OPEN_EVENTS, keys.ANY_STATISTICS, keys.FLOOR, keys.ANY_INTERJECTION,
    keys.SAME_PEOPLE,
)  # fmt: skip
"""Expressions for all that a person watches, or a program that drives the robot."""
ANY_STATUS = keys.status("*")
_ASKING = (keys.ANY_ROBOT_ALIVE, keys.ANY_CLIENT_ALIVE)
"""Presence of those whom a service has to know: all who may ask it for something."""
_OWN_FAULT = keys.fault(OWN)
_OWN_SETTINGS = keys.settings(OWN)
_OWN_ONGOING = keys.perceived_ongoing(OWN, "*")
_RARELY = "sent when something goes wrong"
_WITHDRAWN = "sent when a request is withdrawn"
_LONG = "sent for a request that goes on for a second"


def _commands(role: str, *subjects: str, why: str = "") -> Iterator[Row]:
    """Rows for sending these commands, and for withdrawing and keeping alive what was asked for."""
    servers = dict.fromkeys(keys.server_of(SERVED[subject]) for subject in subjects)
    expressions = [(SERVED[subject], why) for subject in subjects]
    expressions += [(keys.cancel(server), why or _WITHDRAWN) for server in servers]
    expressions += [(keys.keep_alive(server), why or _LONG) for server in servers]
    for expression, reason in expressions:
        yield Row(role, "publishes", keys.command(expression, role, OWN), reason)


def _service(name: str, *published: str, heard: tuple[str, ...], served: tuple[str, ...] = ()) -> Iterator[Row]:
    """Rows of one of the robot's services, without the commands that it sends itself."""
    yield Row(name, "publishes", keys.request_state(name))
    yield Row(name, "publishes", _OWN_FAULT, _RARELY)
    yield Row(name, "publishes", _OWN_SETTINGS)
    yield Row(name, "publishes", keys.taken(name), "told while somebody records")
    yield from (Row(name, "publishes", each) for each in published)
    yield from (Row(name, "subscribes", each) for each in (keys.commands(name), *_ASKING, *heard))
    yield from (Row(name, "serves", each) for each in (keys.status(OWN), *served))
    yield Row(name, "asks", ANY_STATUS, "asked by a service that waits for another, to say why")


def _watches(role: str, presence: str, why: str = "") -> Iterator[Row]:
    """presence: expression for the participants that it has to know."""
    yield from (Row(role, "subscribes", each, why) for each in (*WATCHED, presence))
    yield Row(role, "publishes", _OWN_FAULT, _RARELY)
    yield Row(role, "asks", ANY_STATUS, "asked by a program that waits for a service, to say why")
    yield Row(role, "asks", keys.DESCRIBE, "for programs that suit what they ask for to the body")


def _manages(role: str, presence: str, *more: str, why: str = "") -> Iterator[Row]:
    yield from _watches(role, presence, why)
    yield from (Row(role, "subscribes", each, why) for each in (keys.TURN_CLOSED, keys.WORLD))
    yield from _commands(role, "fragment", "inhibit", "block", *more, why=why)
    yield Row(role, "serves", keys.status(OWN), why)


def _looks(role: str, *more: str) -> Iterator[Row]:
    """Rows for what `engage console` shows besides what people watch."""
    shown = (
        keys.NET,
        keys.ROBOT_STATE,
        keys.ROBOT_MOTION,
        keys.ROBOT_ONGOING,
        keys.ANY_PERCEIVED_ONGOING,
        keys.ROBOT_SOUND,
        keys.settings("hearing"),
        *more,
    )
    yield from (Row(role, "subscribes", key, "shown by `engage console`") for key in shown)


_RAW = (keys.ANY_HEAD_POSE, keys.ANY_LOOKED, keys.ANY_VOICE_ACTIVITY)
_NO_PROGRAM = "of no program of ours: for those of others"

TABLE: tuple[Row, ...] = (
    *_service(
        "generation", keys.FRAGMENT_FEEDBACK, keys.TURN_CLOSED, keys.HEAD_OWNER, keys.STUDY_CONDITION,
        heard=(keys.ANY_REQUEST_STATE, keys.FEEDBACK, keys.ANY_CONNECTION_EVENT, keys.WORLD, keys.SYNC_POINT,
               keys.ANY_ACTION, keys.ANY_PERCEIVED_ONGOING, keys.UTTERANCE, keys.ROBOT_STATE, keys.ANY_STATISTICS,
               keys.ANY_INTERJECTION, keys.FLOOR, keys.SAME_PEOPLE),
    ),
    *_commands("generation", "block", "behavior", "turn"),
    Row("generation", "asks", keys.DESCRIBE),
    Row("generation", "asks", keys.ESTIMATE),
    *_service("realizer", keys.FEEDBACK, keys.NET, keys.HELD, heard=(keys.ANY_REQUEST_STATE, keys.SYNC_POINT)),
    *_commands("realizer", "behavior", "event", "turn"),
    Row("realizer", "asks", keys.ESTIMATE),
    *_service(
        "recognition", keys.ANY_CONNECTION_EVENT, keys.RECOGNIZED_ACTION, keys.ANY_OPEN_EVENTS, keys.ANY_STATISTICS,
        keys.ANY_INTERJECTION, keys.FLOOR, keys.SAME_PEOPLE,
        heard=(keys.ROBOT_ACTION, keys.PERCEIVED_ACTION, keys.UTTERANCE, keys.ROBOT_ONGOING,
               keys.ANY_PERCEIVED_ONGOING,
               keys.FEEDBACK, keys.HEAD_OWNER, keys.WORLD, *_RAW, keys.ROBOT_STATE, keys.SYNC_POINT),
    ),
    *_service(
        "control", keys.SYNC_POINT, keys.ROBOT_ACTION, keys.ROBOT_ONGOING, keys.ROBOT_STATE, keys.ROBOT_MOTION,
        keys.BODY_HELD, keys.BODY_FAULTS, keys.ROBOT_SEEN, heard=(keys.WORLD, keys.SAME_PEOPLE),
        served=(keys.ESTIMATE, keys.DESCRIBE),
    ),
    *(
        Row("perception", "publishes", key)
        for key in (keys.WORLD, keys.PERCEIVED_ACTION, keys.UTTERANCE, _OWN_ONGOING, *_RAW)
    ),
    Row("perception", "publishes", _OWN_FAULT, _RARELY),
    Row("perception", "publishes", _OWN_SETTINGS),
    *(
        Row("perception", "subscribes", key)
        for key in (keys.ANY_ROBOT_ALIVE, keys.WORLD, keys.FEEDBACK, keys.SYNC_POINT, keys.ROBOT_ACTION,
                    keys.ANY_CONNECTION_EVENT, keys.ROBOT_MOTION, keys.ROBOT_SEEN, keys.BODY_FAULTS)
    ),
    Row("control", "publishes", keys.ROBOT_SOUND, "told while somebody plays it, or tells it from people's voices"),
    Row("perception", "publishes", keys.ANY_LANDMARKS, "of cameras: points of faces, for recordings"),
    Row("perception", "subscribes", keys.ANY_LANDMARKS, "for eyes, of the cameras of pages"),
    Row("perception", "subscribes", keys.ANY_HEAD_POSE, "for hearing: whose lips move with a voice"),
    Row("perception", "publishes", keys.ANY_SOUND, "of microphones"),
    Row("perception", "subscribes", keys.ANY_SOUND, "for those who hear what people say"),
    Row("perception", "subscribes", keys.ROBOT_SOUND, "told from the voices of people"),
    Row("perception", "serves", keys.status(OWN)),
    Row("perception", "asks", ANY_STATUS, "asked by a service that waits for another, to say why"),
    *_manages("manager", keys.ANY_ROBOT_ALIVE),
    Row("manager", "subscribes", keys.alive(OWN, "client"), "for a service: is there one of its name?"),
    Row("manager", "publishes", _OWN_SETTINGS),
    *(Row("manager", "subscribes", key) for key in (keys.ROBOT_ONGOING, keys.ANY_PERCEIVED_ONGOING)),
    *_watches("observer", keys.ANY_ALIVE),
    *_looks("observer", keys.WORLD),
    Row("observer", "subscribes", keys.TURN_CLOSED, _NO_PROGRAM),
    *(
        Row("observer", "subscribes", key, "recorded by `engage record`")
        for key in (keys.ANY_TAKEN, keys.ROBOT_SEEN, keys.ANY_SETTINGS, keys.ANY_LANDMARKS)
    ),
    *_watches("operator", keys.ANY_ALIVE, "what an operator sees"),
    *_looks("operator", keys.WORLD),
    *_commands("operator", "robot", "faults", "condition"),
    Row("operator", "publishes", keys.command(keys.BLOCK, "operator", OWN), "holds, continues and stops one block"),
    *_manages(
        "wizard", keys.ANY_ALIVE, "robot", "faults", "condition", why="drives the robot by hand, in `engage console`"
    ),
    *_looks("wizard"),
    *(
        Row("wizard", "publishes", key, "says what perception does not see; visitors of `engage console` are people")
        for key in (keys.PERCEIVED_ACTION, keys.UTTERANCE, _OWN_ONGOING, keys.WORLD, keys.ANY_SOUND,
                    keys.ANY_LANDMARKS)
    ),
    Row("wizard", "publishes", _OWN_SETTINGS, "of the door"),
    Row("wizard", "subscribes", keys.ANY_HEAD_POSE, "for the places of visitors whom a camera of their page sees"),
)  # fmt: skip
"""The table. `tests/access` checks it against what really flows."""

ROLES = tuple(dict.fromkeys(row.role for row in TABLE))
"""Roles that a holder may have, without `ROUTER`."""
PARTICIPANTS = {
    **{name: name for name in keys.SERVICES},
    "simulation": "perception",
    "hearing": "perception",
    "eyes": "perception",
    "pieces": "perception",
    "collaboration": "manager",
    "door": "wizard",
}
"""Roles of the services that have another name."""


def role_of(name: str) -> str:
    """Role of a participant of this name who was given none: that of the service, or a manager's.

    Those who only start a robot, as `up`, observe it.
    """
    return "observer" if name == "up" else PARTICIPANTS.get(name, "manager")


@lru_cache(64)
def rows(role: str, does: Does) -> tuple[str, ...]:
    """Keys of all rows of a role, `OWN` among them."""
    return tuple(row.key for row in TABLE if (row.role, row.does) == (role, does))


def owned(key: str, name: str) -> str:
    """Put a holder's name, or an expression for it, into the key of a row."""
    return key.replace(OWN, name)


@lru_cache(4096)  # asked for every message
def may_have_sent(run: str, key: str) -> bool:
    """Tell whether the process with id `run` belongs to a holder who may publish on this key.

    The rules do not see the id of the sender, which stands beside the message; they see it in the bus' own keys.
    """
    return any(_is_marked(run, role, row, key) for role in ROLES for row in rows(role, "publishes"))


@lru_cache(4096)
def rank(run: str) -> int:
    """Rank of the process with id `run` among those whose words contradict one another; the first is 0.

    The robot and its senses go before those who ask something of it, and these before those who only watch.
    """
    ranks = ((*keys.SERVICES, "perception"), ("manager", "operator", "wizard"))
    return next((at for at, roles in enumerate(ranks) if run.startswith(tuple(map(_role_mark, roles)))), len(ranks))


def _is_marked(run: str, role: str, row: str, key: str) -> bool:
    if not run.startswith(_role_mark(role)) or not keys.matches(owned(row, "*"), key):
        return False
    if OWN not in row:
        return True
    name = key.split("/")[row.split("/").index(OWN)]
    holders = [name, *(name[:at] for at, letter in enumerate(name) if letter == "-")]
    return any(run.startswith(f"{_role_mark(role)}{_name_mark(holder)}") for holder in holders)


@lru_cache(64)
def _role_mark(role: str) -> str:
    return f"e{_hash(role)[:3]}"  # a letter first: Zenoh drops zeros there


@lru_cache(4096)
def _name_mark(name: str) -> str:
    return _hash(name)[:4]


def _hash(text: str) -> str:
    return sha256(text.encode()).hexdigest()
