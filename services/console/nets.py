"""Nets of live blocks with their tokens, as values, and the lines of what fires and which tokens come.

They are made of `NetPlanned`, `NetMarked` and `NetWaiting` alone.

`feed(nets, message, at, now)` gives the next nets, `told` says what a message changed. `laid_out` says which instant
is in which column, and which behavior or place between behaviors in which row: the page and the drawing of
`engage plan` show the same layout.
"""

from collections.abc import Iterator, Mapping

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.blocks import Fired, NetMarked, NetPlace, NetPlanned, NetTransition, NetWaiting
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerGone
from engage_hri.schemas.units import Seconds
from engage_hri.services.console.view import OWN_BLOCKS
from engage_hri.services.console.web.sections import NetInstant, NetRow, NetShown, NetSpot, Tokens, Zero
from engage_hri.services.console.wording import seconds

FORGOTTEN: Seconds = 7.0
"""Time after which a net is forgotten of which nothing was heard: each is told again every two seconds."""
SHOWN_AT_END: Seconds = 1.5
"""Time for which a net is still shown when its block has ended."""


class NetInView(Struct, frozen=True, kw_only=True):
    """The net of a block. began: local instant of the block's start. marked: places that hold a token.

    fired: transitions with their times, seconds from the block's start. heard: when something was told of it last.
    is_over: the block has ended. waits_for: blocks that have to end before it begins: it has no net yet, and `began`
    is when it began to wait.
    """

    block: str
    transitions: tuple[NetTransition, ...]
    places: tuple[NetPlace, ...]
    marked: frozenset[int]
    fired: Mapping[int, Seconds]
    began: Seconds = 0.0
    heard: Seconds = 0.0
    is_over: bool = False
    waits_for: tuple[str, ...] = ()


Nets = Mapping[str, NetInView]
"""By the id of the block, the oldest first."""


def in_view(message: NetPlanned, began: Seconds = 0.0, now: Seconds = 0.0) -> NetInView | None:
    """The net that a message tells; None if it is none: a place that leads nowhere, or no instants at all."""
    size = len(message.transitions)
    is_net = size > 0 and all(0 <= end < size for each in message.places for end in (each.source, each.target))
    if not is_net:
        return None
    return NetInView(
        block=message.block,
        transitions=message.transitions,
        places=message.places,
        marked=frozenset(message.marked) & frozenset(range(len(message.places))),
        fired=_times(message.fired, size),
        began=began,
        heard=now,
    )


def _waiting(block: str, waits_for: tuple[str, ...], began: Seconds, now: Seconds) -> NetInView:
    """A block that has no net yet."""
    nothing = frozenset[int]()
    return NetInView(
        block=block, transitions=(), places=(), marked=nothing, fired={}, began=began, heard=now, waits_for=waits_for
    )


def _times(fired: tuple[Fired, ...], size: int) -> dict[int, Seconds]:
    return {each.transition: each.time for each in fired if 0 <= each.transition < size}


def feed(nets: Nets, message: Message, at: Seconds, now: Seconds) -> Nets:
    """Change the nets by a message. at: its local instant. What is told of an unknown block changes nothing.

    Without its realizer no net goes on. One that was only cut off tells its nets again when it is back.
    """
    match message:
        case NetPlanned(block=block) if (net := in_view(message, at, now)) is not None:
            return {**nets, block: net}
        case NetWaiting(block=block, waits_for=waits_for) if waits_for:
            return {**nets, block: _waiting(block, waits_for, at, now)}
        case NetMarked(block=block) if (known := nets.get(block)) is not None:
            put = frozenset(message.put) & frozenset(range(len(known.places)))
            net = replace(
                known,
                marked=(known.marked | put) - frozenset(message.taken),
                fired={**known.fired, **_times(message.fired, len(known.transitions))},
                heard=now,
                is_over=known.is_over or message.is_over,
            )
            return {**nets, block: net}
        case PeerGone(participant="realizer"):
            return {
                block: net if net.is_over else replace(net, heard=now, is_over=True) for block, net in nets.items()
            }
    return nets


def without_old(nets: Nets, now: Seconds) -> Nets:
    """The nets without those that ended a moment ago, or that nobody speaks of any more."""
    return {
        block: net for block, net in nets.items() if now - net.heard < (SHOWN_AT_END if net.is_over else FORGOTTEN)
    }


def told(before: NetInView | None, after: NetInView) -> Iterator[str]:
    """Lines about what has changed in a net: a new one, instants that fired, tokens that came, the end.

    Tokens that lie in a new net where they lay in the old one, by the words for it, are not told again.
    """
    block = after.block
    if after.waits_for and (before is None or before.waits_for != after.waits_for):
        yield f"{block}: waits for {', '.join(after.waits_for)}"
    if after.waits_for:
        if after.is_over:
            yield f"{block}: over"
        return
    if before is not None and before.waits_for:
        before = None
    is_new = before is None or (before.transitions, before.places) != (after.transitions, after.places)
    if is_new or before is None:
        anew = "" if before is None else ", planned anew"
        yield f"{block}: net of {len(after.transitions)} instants and {len(after.places)} places{anew}"
        old_fired: Mapping[int, Seconds] = {} if before is None else after.fired
        old = {where(before, before.places[each]) for each in before.marked} if before is not None else set()
        old_marked = {each for each in after.marked if where(after, after.places[each]) in old}
    else:
        old_fired, old_marked = before.fired, {*before.marked}
    for transition, time in after.fired.items():
        if transition not in old_fired:
            instant = after.transitions[transition]
            yield f"{block}: {instant.name} fired at {seconds(time)} (planned {seconds(instant.time)})"
    for number in sorted(after.marked - old_marked):
        yield f"{block}: ● {where(after, after.places[number])}"
    if after.is_over and not (before is not None and before.is_over):
        yield f"{block}: over"


def where(net: NetInView, place: NetPlace) -> str:
    """Words for a place: `point-1 from ready to stroke_start`."""
    source, target = net.transitions[place.source], net.transitions[place.target]
    if place.kind == "idle":
        return f"{place.behavior or net.block} at rest"
    if place.kind == "phase":
        since, to = (sync_of(each, place.behavior) for each in (source, target))
        return f"{place.behavior} from {since} to {to}"
    if place.behavior and place.kind == "order" and not place.lag:
        if place.source == 0:
            return f"{place.behavior} waits for its start{_awaited(net, place)}"
        if place.target == len(net.transitions) - 1:
            return f"{place.behavior} waits for the end of the block"
    lag = f" {seconds(place.lag)}" if place.lag else ""
    return f"{place.kind}{lag} from {source.name} to {target.name}"


def _awaited(net: NetInView, place: NetPlace) -> str:
    """Say after which instants a behavior is to start, and with which points of others; nothing if with none."""
    before = {
        each.source
        for each in net.places
        if each.target == place.target and each.source and each.kind not in ("idle", "phase")
    }
    after = [net.transitions[each].name for each in sorted(before)]
    together = [str(each) for each in net.transitions[place.target].points if each.behavior != place.behavior]
    said = (("after", after), ("with", together))
    return "".join(f", {word} {' and '.join(names)}" for word, names in said if names)


def sync_of(transition: NetTransition, behavior: str) -> str:
    """The first sync point that a behavior has in an instant; empty if it has none."""
    return next((each.sync for each in transition.points if each.behavior == behavior), "")


REST = -1
"""Column of the places of a behavior at rest, left of all instants."""
BLOCK = "bml"
"""Name of the row of the block itself."""
TIES = ("delay", "order", "handover", "series")
"""Places between behaviors, the most interesting first."""


def laid_out(net: NetInView, zero: Zero) -> NetShown:
    """The net as it is drawn, without its tokens."""
    columns = {transition: column for column, transition in enumerate(_ordered(net))} if net.transitions else {}
    names = _behaviors(net, columns) if net.transitions else {}
    ties = _ties(net) if net.transitions else {}
    row_of = {name: number for number, name in enumerate((*names, *ties))}
    return NetShown(
        block=net.block,
        since=zero(net.began),
        own=net.block.startswith(OWN_BLOCKS),
        waits_for=net.waits_for,
        rows=(
            *(NetRow(name or BLOCK, False, tuple(points)) for name, points in names.items()),
            *(NetRow(f"{kind} {lag:g} s" if lag else kind, True, ()) for kind, _, _, lag in ties),
        ),
        instants=tuple(
            NetInstant(instant.name, instant.time, columns[number], _span(instant, list(names)))
            for number, instant in enumerate(net.transitions)
        ),
        places=tuple(_spot(net, place, row_of[_owner(net, place)], columns) for place in net.places),
    )


def tokens(net: NetInView) -> Tokens:
    """The tokens of a net, and what has fired."""
    return Tokens(net.block, tuple(sorted(net.marked)), dict(net.fired), net.is_over)


Tie = tuple[str, int, int, Seconds]
"""Kind, source, target and time of places between behaviors that say the same."""


def _ordered(net: NetInView) -> list[int]:
    """Transitions by their planned times; the end of the block is the last."""
    end = len(net.transitions) - 1
    return sorted(range(end + 1), key=lambda each: (each == end, net.transitions[each].time, each))


def _behaviors(net: NetInView, columns: dict[int, int]) -> dict[str, list[tuple[int, str]]]:
    """Columns and sync points of the block itself, whose name is empty, then of behaviors by their first instant."""
    points: dict[str, list[tuple[int, str]]] = {}
    for transition, column in columns.items():
        here: dict[str, list[str]] = {}
        for point in net.transitions[transition].points:
            here.setdefault(point.behavior, []).append(point.sync)
        for name, syncs in here.items():
            points.setdefault(name, []).append((column, " = ".join(syncs)))
    for place in net.places:
        if isinstance(owner := _owner(net, place), str):
            points.setdefault(owner, [])
    return {name: points[name] for name in sorted(points, key=lambda name: name != "")}


def _ties(net: NetInView) -> dict[Tie, None]:
    """The places between behaviors, in the order of `TIES`."""
    found = dict.fromkeys(tie for place in net.places if isinstance(tie := _owner(net, place), tuple))
    ranks = {kind: rank for rank, kind in enumerate(TIES)}
    return dict.fromkeys(sorted(found, key=lambda tie: ranks.get(tie[0], len(TIES))))


def _owner(net: NetInView, place: NetPlace) -> str | Tie:
    """The behavior on whose row a place lies, or the tie that it is between behaviors."""
    end = len(net.transitions) - 1
    if place.kind in ("phase", "idle") or (not place.lag and (place.source == 0 or place.target == end)):
        return place.behavior
    return (place.kind, place.source, place.target, place.lag)


def _span(instant: NetTransition, names: list[str]) -> tuple[int, int]:
    """First and last row of the behaviors that share an instant."""
    shared = [names.index(name) for name in {point.behavior for point in instant.points} if name in names]
    return (min(shared), max(shared)) if shared else (0, 0)


def _spot(net: NetInView, place: NetPlace, row: int, columns: dict[int, int]) -> NetSpot:
    at_rest = place.kind == "idle"
    return NetSpot(
        row=row,
        source=REST if at_rest else columns[place.source],
        target=REST if at_rest else columns[place.target],
        kind=place.kind,
        lag=place.lag,
        words=where(net, place),
    )
