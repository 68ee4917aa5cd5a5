"""Nets of live blocks with their tokens, as values: made of `NetPlanned`, `NetMarked` and `NetWaiting` alone.

`feed(nets, message, at, now)` gives the next nets; `services/commandline/talk/net_drawing.py` draws one, `told` says
what a message changed.
"""

from collections.abc import Iterator, Mapping

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.blocks import Fired, NetMarked, NetPlace, NetPlanned, NetTransition, NetWaiting
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerGone
from engage_hri.schemas.units import Seconds
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
