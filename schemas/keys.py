"""Keys of the bus, relative to the robot's namespace: on the wire `<robot>/engage/v1/...`.

The form is `engage/v1/<class>/<producer or server>/<subject>`, for commands
`engage/v1/cmd/<server>/<role>/<requester>/<subject>`, so that rules for access can see who asks. The class decides
how a message travels:

| class  | for | how |
|--------|-----|-----|
| cmd    | requests to a server | each, in order; late subscribers get the last 2 s; idempotent by id |
| evt    | request states, feedback, sync points, actions, words, connection events, faults | as cmd |
| state  | world, ongoing actions, statistics, open events, claims | last value, also for a late subscriber |
| stream | joints, raw perception | newest only, may be dropped |
| rpc    | short reads | query, short timeout, no reply = failure |
| alive  | presence of participants | liveliness; delivered as `PeerAlive` and `PeerGone` |
"""

from collections.abc import Iterable
from functools import lru_cache
from typing import Literal, get_args

PREFIX = "engage/v1"
KeyClass = Literal["cmd", "evt", "state", "stream", "rpc", "alive"]
HISTORY_MAX_AGE = 2.0
"""Seconds: how old a command or event may be when a late subscriber still gets it."""

# The expression for the commands of all requesters. `command` makes the key of one requester.
FRAGMENT = f"{PREFIX}/cmd/generation/*/*/fragment"
INHIBIT = f"{PREFIX}/cmd/generation/*/*/inhibit"
CONDITION = f"{PREFIX}/cmd/generation/*/*/condition"
"""For the condition of a study: a key of its own, so that rules can keep it to a few."""
BLOCK = f"{PREFIX}/cmd/realizer/*/*/block"
EVENT = f"{PREFIX}/cmd/recognition/*/*/event"
TURN = f"{PREFIX}/cmd/recognition/*/*/turn"
ROBOT = f"{PREFIX}/cmd/realizer/*/*/robot"
"""For all that the robot performs, whoever asked for it: a key of its own, so that rules can keep it to a few."""
BEHAVIOR = f"{PREFIX}/cmd/control/*/*/behavior"
FAULTS = f"{PREFIX}/cmd/control/*/*/faults"
"""For faults that a simulated body is to play: a key of its own, so that rules can keep it to a few."""

FEEDBACK = f"{PREFIX}/evt/realizer/feedback"
FRAGMENT_FEEDBACK = f"{PREFIX}/evt/generation/feedback"
TURN_CLOSED = f"{PREFIX}/evt/generation/turn"
SYNC_POINT = f"{PREFIX}/evt/control/sync_point"
ROBOT_ACTION = f"{PREFIX}/evt/control/action"
PERCEIVED_ACTION = f"{PREFIX}/evt/perception/action"
UTTERANCE = f"{PREFIX}/evt/perception/utterance"
"""`Utterance`: the words of people."""
RECOGNIZED_ACTION = f"{PREFIX}/evt/recognition/action"
"""Actions that recognition finds in raw perception; the same messages as on `PERCEIVED_ACTION`."""
ANY_TAKEN = f"{PREFIX}/evt/*/taken"
"""Ledgers of what services took, while somebody listens."""
ANY_CONNECTION_EVENT = f"{PREFIX}/evt/recognition/connection_event/*/*"

WORLD = f"{PREFIX}/state/perception/world"
HEAD_OWNER = f"{PREFIX}/state/generation/head_owner"
STUDY_CONDITION = f"{PREFIX}/state/generation/condition"
HELD = f"{PREFIX}/state/realizer/held"
BODY_HELD = f"{PREFIX}/state/control/held"
BODY_FAULTS = f"{PREFIX}/state/control/faults"
ROBOT_ONGOING = f"{PREFIX}/state/control/ongoing_actions"
"""`OngoingActions` of the robot."""
ROBOT_STATE = f"{PREFIX}/state/control/robot_state"
ROBOT_SEEN = f"{PREFIX}/state/control/seen"

FLOOR = f"{PREFIX}/state/recognition/floor"
"""`Floor`."""
SAME_PEOPLE = f"{PREFIX}/state/recognition/same_people"
"""`SamePeople`: which ids are one person."""
ROBOT_MOTION = f"{PREFIX}/stream/control/robot_state"
"""The same as `ROBOT_STATE`, many times a second, while somebody listens."""
NET = f"{PREFIX}/stream/realizer/net"
ANY_HEAD_POSE = f"{PREFIX}/stream/perception/head/*"
ANY_LOOKED = f"{PREFIX}/stream/perception/looked/*"
ANY_VOICE_ACTIVITY = f"{PREFIX}/stream/perception/voice/*"
ANY_LANDMARKS = f"{PREFIX}/stream/perception/landmarks/*"
"""`FaceLandmarks` of all sources."""
SOUND = "@sound"
"""Chunk in the keys of sound: no wildcard includes it, so that nobody hears or records a voice by accident."""
ROBOT_SOUND = f"{PREFIX}/stream/control/{SOUND}"
"""`SoundFrame`: what the robot's voice says, a moment before it is heard, while somebody listens."""
ANY_SOUND = f"{PREFIX}/stream/perception/{SOUND}/*"
"""`SoundFrame` of all microphones."""

ESTIMATE = f"{PREFIX}/rpc/control/estimate"
DESCRIBE = f"{PREFIX}/rpc/control/describe"

ANY_REQUEST_STATE = f"{PREFIX}/evt/*/request"
ANY_FEEDBACK = f"{PREFIX}/evt/*/feedback"
ANY_FAULT = f"{PREFIX}/evt/*/fault"
ANY_ACTION = f"{PREFIX}/evt/*/action"
ANY_PERCEIVED_ONGOING = f"{PREFIX}/state/perception/ongoing_actions/*/*"
ANY_OPEN_EVENTS = f"{PREFIX}/state/recognition/open_events/*"
ANY_STATISTICS = f"{PREFIX}/state/recognition/statistics/*"
ANY_INTERJECTION = f"{PREFIX}/evt/recognition/interjection/*"
ANY_SETTINGS = f"{PREFIX}/state/*/settings"
ANY_ALIVE = f"{PREFIX}/alive/*/*"
ANY_ROBOT_ALIVE = f"{PREFIX}/alive/robot/*"
"""Presence of all whom everybody hears: what a client needs to know."""
ANY_CLIENT_ALIVE = f"{PREFIX}/alive/client/*"
EVERYTHING = f"{PREFIX}/**"


def of_class(kind: KeyClass) -> str:
    """Expression for every key of a class."""
    return f"{PREFIX}/{kind}/**"


Flow = Literal["commands", "news"]
"""Messages of which a late subscriber gets what was published before go two ways: commands to a server, and news
from where it happens to whoever wants it. Processes ask one another by flow. So clients, which send commands and hear
news, have nothing to do with one another."""
FLOWS: dict[Flow, tuple[KeyClass, ...]] = {"commands": ("cmd",), "news": ("state", "evt")}
"""Classes of each flow. The other classes have no past."""


def flow_of(key: str) -> Flow:
    """Flow of a key of a class that has a past."""
    return "commands" if key_class(key) == "cmd" else "news"


@lru_cache(4096)
def flows(pattern: str) -> tuple[Flow, ...]:
    """Flows of which the pattern may include keys."""
    name = pattern.split("/")[2:3]
    return tuple(flow for flow, kinds in FLOWS.items() if name in (["*"], ["**"]) or {*name} & {*kinds})


SERVICES = ("generation", "realizer", "recognition", "control")
"""Services that make up a robot."""
ROLES = ("manager", *SERVICES, "perception", "observer", "operator", "wizard")
"""Roles of participants. What each may do is in schemas/access.py."""
Part = Literal["robot", "client", "observer"]
"""Part of a participant, in the key of its presence. `robot`: everybody hears it. `client`: it asks for something,
and the robot has to know when it goes. `observer`: it only listens, and nobody depends on it."""


def part_of(role: str) -> Part:
    """Part of the participants with this role. A wizard says what people do, as perception does."""
    if role in (*SERVICES, "perception", "wizard"):
        return "robot"
    return "observer" if role == "observer" else "client"


def taken(service: str) -> str:
    """Key of the ledger of a service."""
    return f"{PREFIX}/evt/{service}/taken"


def commands(server: str) -> str:
    """Expression for every key below the commands of `server`, cancellations and unknown keys among them."""
    return f"{PREFIX}/cmd/{server}/**"


def cancel(server: str) -> str:
    """Expression for the cancellations of all requesters."""
    return f"{PREFIX}/cmd/{server}/*/*/cancel"


def keep_alive(server: str) -> str:
    """Expression for `KeepAlive` of all requesters."""
    return f"{PREFIX}/cmd/{server}/*/*/keep_alive"


@lru_cache(4096)  # asked for every command
def command(expression: str, role: str, requester: str) -> str:
    """Make the key on which one requester sends this command. Raises ValueError for a name that can't be in a key."""
    *before, _, _, subject = expression.split("/")
    for name in (role, requester):
        if not is_chunk(name):
            raise ValueError(f"{name!r} can't be in a key: {CHUNK}")
    return "/".join((*before, role, requester, subject))


def is_command_of(server: str, key: str) -> bool:
    """Tell whether `commands(server)` includes the key."""
    return f"{key}/".startswith(f"{PREFIX}/cmd/{server}/")


@lru_cache(4096)  # asked for every command
def expression_of(key: str) -> str:
    """Turn a command's key into the expression for all requesters; empty if it lacks a role or a requester."""
    chunks = key.split("/")
    return "/".join((*chunks[:4], "*", "*", chunks[6])) if len(chunks) == 7 else ""


@lru_cache(4096)  # asked for every command
def requester_of(key: str) -> str:
    """Requester in `engage/v1/cmd/<server>/<role>/<requester>/<subject>`; empty if there is none."""
    chunks = key.split("/")
    return chunks[5] if len(chunks) == 7 else ""


def request_state(server: str) -> str:
    """Key on which `server` answers requests: `Accepted`, `Refused`, outcomes."""
    return f"{PREFIX}/evt/{server}/request"


def fault(service: str) -> str:
    return f"{PREFIX}/evt/{service}/fault"


def settings(participant: str) -> str:
    """Key of the settings under which a service runs."""
    return f"{PREFIX}/state/{participant}/settings"


def status(participant: str) -> str:
    return f"{PREFIX}/rpc/{participant}/status"


def statistics(actor: str) -> str:
    """Key of the statistics of one person. actor: the person's id, or `all`."""
    return f"{PREFIX}/state/recognition/statistics/{actor}"


def connection_event(actor: str, kind: str) -> str:
    """Key of connection events with a person (`actor`) of one kind, an `EventKind`; each may be `*`."""
    return f"{PREFIX}/evt/recognition/connection_event/{actor}/{kind}"


def event_stream(actor: str = "", kinds: Iterable[str] = ()) -> tuple[str, ...]:
    """Expressions for a reader of connection events: the events, the open ones, and the presence of recognition.

    actor: a person's id; empty: all. kinds: empty: all. Raises ValueError for an id that can't be in a key.
    """
    person = chunk(actor)
    events = [connection_event(person, chunk(kind)) for kind in kinds] or [connection_event(person, "*")]
    return (*events, open_events(person), alive("recognition"))


CHUNK = "no '/', '*', '$', '?', '#', and no '@' at its beginning"


def chunk(name: str) -> str:
    """Turn a name into one chunk of a key expression; an empty one into `*`. Raises ValueError for bad letters."""
    if not is_chunk(name or "all"):
        raise ValueError(f"{name!r} can't be in a key: {CHUNK}")
    return name or "*"


def is_chunk(name: str) -> bool:
    """Tell whether a name can stand in a key, where wildcards reach it."""
    return bool(name) and name[0] != "@" and not any(letter in "/*$?#" for letter in name)


def interjection(actor: str) -> str:
    """Key of what a person says into the robot's turn."""
    return f"{PREFIX}/evt/recognition/interjection/{actor}"


def open_events(actor: str) -> str:
    """Key of the open connection events with one person."""
    return f"{PREFIX}/state/recognition/open_events/{actor}"


def perceived_ongoing(reporter: str, actor: str) -> str:
    """Key of what a person does (`actor`), as the participant `reporter` perceives it; each may be `*`."""
    return f"{PREFIX}/state/perception/ongoing_actions/{reporter}/{actor}"


def reporter_of(key: str) -> str:
    """Reporter in `engage/v1/state/perception/ongoing_actions/<reporter>/<actor>`; empty for another key."""
    return key.split("/")[5] if matches(ANY_PERCEIVED_ONGOING, key) else ""


def head_pose(actor: str) -> str:
    return f"{PREFIX}/stream/perception/head/{actor}"


def looked(source: str) -> str:
    """Key of what a source of head poses has looked at. source: a name of its own."""
    return f"{PREFIX}/stream/perception/looked/{source}"


def voice_activity(actor: str) -> str:
    return f"{PREFIX}/stream/perception/voice/{actor}"


def landmarks(source: str) -> str:
    """Key of the faces in the pictures of a source. source: a name of its own."""
    return f"{PREFIX}/stream/perception/landmarks/{source}"


def sound(source: str) -> str:
    """Key of the sound of a microphone. source: id of the person whose it is, or a name of its own."""
    return f"{PREFIX}/stream/perception/{SOUND}/{source}"


def alive(participant: str, part: Part = "robot") -> str:
    """Key of the presence of a participant."""
    return f"{PREFIX}/alive/{part}/{participant}"


def is_presence(key: str) -> bool:
    """Tell whether the key is that of a participant who comes or goes."""
    return key.startswith(f"{PREFIX}/alive/")


def presence(pattern: str) -> str:
    """Expression for the presence of all whom the pattern includes; empty if it includes nobody's."""
    chunks = pattern.split("/")
    if chunks[2:3] == ["alive"] and len(chunks) == 5 and "**" not in chunks:
        return pattern
    return ANY_ALIVE if chunks[2:3] in (["alive"], ["*"], ["**"]) else ""


# Keys of the bus itself. No wildcard includes a chunk that begins with `@`, so no subscriber gets these by accident.
ANY_OWN = f"{PREFIX}/@bus/*/**"
ANY_PROTOCOL = "engage/*/@bus/*/**"
"""Tokens of processes of every version of the protocol."""


def own(run: str, subject: str) -> str:
    """Key of the process with id `run`.

    subject: of a token `alive/<part>/<name>/<clock>`, `log/<flow>` or `at/<protocol>/<address>`; else `pulse/<flow>`,
    `flush/<flow>`, `past`, `counts` or `clock`.
    """
    return f"{PREFIX}/@bus/{run}/{subject}"


def tokens(presence: str) -> str:
    """Expression for the tokens of all participants in an expression for their presence (`alive`)."""
    return f"{PREFIX}/@bus/*/{presence.removeprefix(f'{PREFIX}/')}/*"


def run_of(key: str) -> str:
    """Id of the process in `engage/v1/@bus/<run>/...`."""
    return key.split("/")[3]


@lru_cache(4096)  # asked several times for every message
def key_class(key: str) -> KeyClass:
    """Class of a key. Raises ValueError for a key outside the table, and for one whose class is a wildcard."""
    chunks = key.split("/")
    name = chunks[2] if key.startswith(f"{PREFIX}/") and len(chunks) > 2 else ""
    if name not in get_args(KeyClass):
        raise ValueError(f"{key!r} is not a key of engage: expected {PREFIX}/<{'|'.join(get_args(KeyClass))}>/...")
    return name  # type: ignore[return-value]


@lru_cache(4096)  # asked for every command and answer
def server_of(key: str) -> str:
    """Server in `engage/v1/cmd/<server>/...` or `engage/v1/evt/<server>/...`."""
    return key.split("/")[3]


def matches(pattern: str, key: str) -> bool:
    """Tell whether the key expression `pattern` (`*`: one chunk, `**`: any number) includes the concrete `key`."""
    return _matches(pattern.split("/"), key.split("/")) if "*" in pattern else pattern == key


def first(patterns: Iterable[str], key: str) -> str | None:
    """Find the first of the key expressions that includes `key`; None: none does."""
    return next((pattern for pattern in patterns if matches(pattern, key)), None)


def includes(pattern: str, narrower: str) -> bool:
    """Tell whether `pattern` includes all that another expression without `**` includes."""
    return _matches(pattern.split("/"), ["x" if each == "*" else each for each in narrower.split("/")])


def _matches(pattern: list[str], key: list[str]) -> bool:
    if not pattern:
        return not key
    if pattern[0] == "**":
        more = bool(key) and not key[0].startswith("@")
        return _matches(pattern[1:], key) or (more and _matches(pattern, key[1:]))
    if not key:
        return False
    is_same = pattern[0] == key[0] or (pattern[0] == "*" and not key[0].startswith("@"))
    return is_same and _matches(pattern[1:], key[1:])
