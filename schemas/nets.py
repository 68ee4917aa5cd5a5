"""Petri net of a live block, and where its tokens are: to watch a block run."""

from msgspec import Struct

from engage_hri.schemas.units import Seconds, Stamp


class NetPoint(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A sync point. behavior: empty for the start and the end of the block itself. sync: as the block spells it."""

    behavior: str = ""
    sync: str = ""

    def __str__(self) -> str:
        return f"{self.behavior or 'bml'}:{self.sync}"


class NetTransition(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """An instant. points: those that share it. time: seconds from the block's start, as planned."""

    points: tuple[NetPoint, ...]
    time: Seconds = 0.0

    @property
    def name(self) -> str:
        """All points, as `gaze-1:stroke = point-1:start`."""
        return " = ".join(map(str, self.points))


class NetPlace(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A place between two transitions, named by their numbers.

    kind: `phase` of a behavior, `delay`, `order`, `series`, `handover` or `idle`. lag: least seconds that a token
    takes through it. behavior: the one that has this phase, or that waits there.
    """

    kind: str
    source: int
    target: int
    lag: Seconds = 0.0
    behavior: str = ""


class Fired(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A transition that has fired, `time` seconds after the block's start."""

    transition: int
    time: Seconds


class NetSpeech(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A speech of a block. behavior: its id. text: the words that it is to say."""

    behavior: str
    text: str


class NetPlanned(Struct, frozen=True, kw_only=True, tag="net_planned", omit_defaults=True):
    """stream: realizer: the net that a block runs on, and where its tokens are; all that a late watcher needs.

    Told at the block's start, when it is planned anew, and every two seconds. Points that the block's dialect gives
    one name are told once.
    at: when the block started. marked: numbers of the places that hold a token. fired: the transitions so far.
    speeches: what the block is to say, in the order of the block, also of speeches that were dropped.
    follows: ids of the blocks before it in the same turn that were live when it came.
    """

    block: str
    at: Stamp
    transitions: tuple[NetTransition, ...]
    places: tuple[NetPlace, ...]
    marked: tuple[int, ...] = ()
    fired: tuple[Fired, ...] = ()
    speeches: tuple[NetSpeech, ...] = ()
    follows: tuple[str, ...] = ()


class NetWaiting(Struct, frozen=True, kw_only=True, tag="net_waiting", omit_defaults=True):
    """stream: realizer: a block waits for its turn, since its composition asks for that; it has no net yet.

    Told when it begins to wait, whenever it waits for fewer, and every two seconds; then `NetPlanned` follows, or a
    `NetMarked` that says that it is over.
    since: when it began to wait. waits_for: ids of the live blocks that have to end before.
    """

    block: str
    since: Stamp
    waits_for: tuple[str, ...] = ()


class NetMarked(Struct, frozen=True, kw_only=True, tag="net_marked", omit_defaults=True):
    """stream: realizer: what has changed in the marking of a block's net since the last message.

    fired: transitions, in order. put: places that hold a token now and did not. taken: places that did and do not.
    is_over: the block has ended.
    """

    block: str
    fired: tuple[Fired, ...] = ()
    put: tuple[int, ...] = ()
    taken: tuple[int, ...] = ()
    is_over: bool = False
