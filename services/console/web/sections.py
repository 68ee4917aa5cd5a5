"""Sections of the picture that the page draws, as it gets them in JSON.

A section is replaced as a whole when something in it has changed. Instants are seconds of the picture. Places are
metres, in the frame of the robot.
"""

from collections.abc import Callable

from msgspec import Struct

from engage_hri.schemas.behaviors import EventKind
from engage_hri.schemas.fragments import PairConsidered
from engage_hri.schemas.recognition import EngagementLevel, EventState
from engage_hri.schemas.units import Meters, Radians, Seconds, Vector

Point = tuple[float, float]
Zero = Callable[[Seconds], Seconds]
"""Conversion of an instant to seconds of the picture."""


class Thing(Struct, frozen=True):
    """An object, a hand or a surface. outline: its corners seen from above, where it lies; empty: a ball."""

    id: str
    kind: str
    at: Vector
    yaw: Radians
    outline: tuple[Point, ...]
    radius: Meters
    color: str
    label: str
    owner: str


class PersonShown(Struct, frozen=True):
    """A person. at: the face; None: the world does not say where.

    looks: ids of what they look at; empty: away; None: nobody says. one_of: it is one of these. points, acts: ids.
    present: False: gone.
    """

    id: str
    at: Vector | None
    present: bool
    looks: tuple[str, ...] | None
    one_of: bool
    points: tuple[str, ...]
    acts: tuple[str, ...]
    nods: str
    speaks: bool


class Arm(Struct, frozen=True):
    """A forearm. side: left or right."""

    side: str
    elbow: Vector
    hand: Vector


class BodyShown(Struct, frozen=True):
    """The robot's body. eyes, gaze: place and direction; None: it has no eyes. spread: half the gaze cone's angle.

    points: ids of what it points at. joints: angles by name, of the face a share of the way.
    """

    eyes: Vector | None
    gaze: Vector | None
    spread: Radians
    arms: tuple[Arm, ...]
    looks_at: str
    points: tuple[str, ...]
    speaking: str
    joints: dict[str, float]


class Above(Struct, frozen=True):
    """The view from above. right, down: parts of x and y in what is to the right and down in it.

    frame: its left, upper, right and lower edge, in metres.
    """

    right: Point
    down: Point
    frame: tuple[Meters, Meters, Meters, Meters]


class SceneSection(Struct, frozen=True):
    """Scene in space. robot: its actor id. body: None: nothing is known of it yet. above: its view from above."""

    robot: str
    body: BodyShown | None
    things: tuple[Thing, ...]
    people: tuple[PersonShown, ...]
    above: Above


class Left(Struct, frozen=True):
    """Words of a turn that were not said. before: characters of the words that were said before them."""

    before: int
    words: str


class UtteranceShown(Struct, frozen=True):
    """A turn of an actor, as far as it is said. words: empty: they are not known. open: it goes on.

    settled: characters of the words that will not change any more. left: words that were not said, or not yet.
    state: why words are left: `held`, `stopped`, `failed`, `lost` with the realizer; `left`: it went on without them.
    """

    actor: str
    since: Seconds
    words: str
    open: bool
    settled: int
    left: tuple[Left, ...] = ()
    state: str = ""


class ClaimShown(Struct, frozen=True):
    """A claim on the head, with the reason.

    does, why: the same in plain words: `look at ann`, and `it spoke to this person last`.
    """

    kind: str
    priority: int
    target: str
    reason: str
    does: str
    why: str


class HeadSection(Struct, frozen=True):
    """Owner of the head since when, and the claims that wait, the strongest first."""

    owner: ClaimShown | None
    since: Seconds
    waiting: tuple[ClaimShown, ...]


class EventShown(Struct, frozen=True):
    """A connection event. by, to: actor ids. since: when it began. decided: when it succeeded or failed.

    until: when it was over.
    """

    id: str
    kind: EventKind
    by: str
    to: str
    about: tuple[str, ...]
    one_of: bool
    cause: str
    state: EventState
    optional: bool
    delay: Seconds | None
    limit: Seconds | None
    since: Seconds
    decided: Seconds | None
    until: Seconds | None


class SpeechShown(Struct, frozen=True):
    """A speech. to: ids of its addressees; empty: not known. until: None: it goes on.

    taken: what it was taken for, in words, if it was said into the robot's turn: `as a listener`. words: of that.
    """

    actor: str
    to: tuple[str, ...]
    since: Seconds
    until: Seconds | None
    taken: str = ""
    words: str = ""


class SyncShown(Struct, frozen=True):
    """A sync point, in seconds of the picture. first: as planned at first. planned: as planned last."""

    sync: str
    first: Seconds | None
    planned: Seconds | None
    measured: Seconds | None


class BehaviorLane(Struct, frozen=True):
    """A behavior of a block, its sync points in order. type: its BML element."""

    id: str
    type: str
    points: tuple[SyncShown, ...]


class BlockLane(Struct, frozen=True):
    """A block. until, status: of its end; `lost` with its realizer.

    ties: sync points of several behaviors that are one instant.
    """

    id: str
    since: Seconds
    until: Seconds | None
    status: str
    own: bool
    behaviors: tuple[BehaviorLane, ...]
    ties: tuple[tuple[tuple[str, str], ...], ...]


class NetRow(Struct, frozen=True):
    """A line of a net. points: columns with their sync points. tie: it is a place between behaviors."""

    name: str
    tie: bool
    points: tuple[tuple[int, str], ...]


class NetInstant(Struct, frozen=True):
    """A transition of a net. column: its place in the order. rows: the first and the last row that it joins."""

    name: str
    planned: Seconds
    column: int
    rows: tuple[int, int]


class NetSpot(Struct, frozen=True):
    """A place of a net, in a row. source, target: columns between which it lies. words: what a token there means."""

    row: int
    source: int
    target: int
    kind: str
    lag: Seconds
    words: str


class NetShown(Struct, frozen=True):
    """A net, without its tokens. waits_for: blocks that have to end before; then it has no net yet."""

    block: str
    since: Seconds
    own: bool
    waits_for: tuple[str, ...]
    rows: tuple[NetRow, ...]
    instants: tuple[NetInstant, ...]
    places: tuple[NetSpot, ...]


class Tokens(Struct, frozen=True):
    """Tokens of a net. marked: places that hold one. fired: transitions with their times since the block's start."""

    block: str
    marked: tuple[int, ...]
    fired: dict[int, Seconds]
    over: bool


class Choice(Struct, frozen=True):
    """A reference as it was made, with all pairs of gesture and phrase that were weighed.

    number: of all references since the picture began; a fragment may come again under its name.
    """

    number: int
    fragment: str
    reference: str
    target: str
    gesture: str
    phrase: str
    reliability: float
    cost: Seconds
    pairs: tuple[PairConsidered, ...]


class PersonMeasures(Struct, frozen=True):
    """Engagement of a person, and courses over time: each is a row of instant and value.

    actor: empty: all people. mtbce: mean time between connection events.
    """

    actor: str
    level: EngagementLevel
    reasons: tuple[str, ...]
    engagement: tuple[Point, ...]
    mtbce: tuple[Point, ...]


class Health(Struct, frozen=True):
    """A participant of the bus. service: one of the four of a robot. facts: what it said of itself, in words."""

    name: str
    service: bool
    here: bool
    serves: bool
    warnings: tuple[str, ...]
    facts: tuple[str, ...]


class Note(Struct, frozen=True):
    """Something that people should know. level: fault, warning or news."""

    at: Seconds
    level: str
    text: str


class Switched(Struct, frozen=True):
    """Holds, faults of the body that are on, and the condition of a study, in words.

    kinds: of these faults. by: who switched them on.
    """

    held: tuple[str, ...]
    faults: tuple[str, ...]
    kinds: tuple[str, ...]
    by: str = ""
    condition: str = ""
