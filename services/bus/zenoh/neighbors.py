"""Hints for a process that waits for others: who is not in sight, and why. They change nothing."""

import asyncio
from collections.abc import AsyncIterator, Callable, Collection, Iterable, Sequence
from contextlib import asynccontextmanager
from socket import gethostname
from typing import Any, NamedTuple

import zenoh

from engage_hri.schemas import keys
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.participants import AskStatus, Status
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.config import is_encrypted, is_on_this_machine
from engage_hri.services.bus.interface import LOG, Bus
from engage_hri.services.bus.zenoh.session import RENDEZVOUS, open_session

LOOK: Seconds = 1.0
"""Time that others have to answer; nothing else waits for that."""
POLL: Seconds = 0.05
AFTER: Seconds = 3.0
"""Time that a process waits before it gets the hint."""
REMEDY = "let all connect to one router (`engage router`), or give it --listen with an address of its machine"


Tell = Callable[[str], None]


class Unseen(NamedTuple):
    """A participant that is not in sight. seen_by: who sees it. places: where others may connect to its process.

    is_near: somebody on this machine sees it. Then a place on this machine can be reached from here, too.
    """

    name: str
    seen_by: tuple[str, ...] = ()
    places: tuple[str, ...] = ()
    is_near: bool = False


@asynccontextmanager
async def hinting(
    bus: Bus, connect: Sequence[str], wanted: Collection[str] = keys.SERVICES, tell: Tell | None = None
) -> AsyncIterator[None]:
    """Run the body of `async with`, and beside it tell who is missing, and who has come after all."""
    hint = asyncio.create_task(_hint(bus, connect, wanted, tell), name="hint")
    try:
        yield
    finally:
        hint.cancel()
        await asyncio.gather(hint, return_exceptions=True)


async def tell_who_is_missing(
    bus: Bus,
    connect: Sequence[str],
    wanted: Collection[str] = keys.SERVICES,
    after: Seconds = AFTER,
    tell: Tell | None = None,
) -> set[str]:
    """Log a warning for those of the `wanted` participants that are not in sight after this time, with the reason.

    connect: the endpoints that this process connects to. tell: takes these lines, too.
    Returns their names.
    """
    await asyncio.sleep(after)

    def still_absent() -> list[str]:
        return sorted(set(wanted) - {bus.name} - set(bus.health.peers))

    if not (absent := still_absent()):
        return set()
    spoken = await versions(connect)
    lines = []
    if set(bus.health.peers) & set(keys.SERVICES) - {bus.name}:
        statuses = await _statuses(bus)
        absent = [name for name in still_absent() if name in absent]  # some came while the others were asked
        lines += told(unseen(absent, statuses, gethostname()))
    else:
        others = sorted(name for name, its in spoken.items() if keys.PREFIX in its and name != bus.robot)
        there = f"; there are: {', '.join(map(repr, others))}" if others else ""
        lines.append(f"no robot {bus.robot!r} here yet{there}; waiting ({_way_in(bus.robot, connect)})")
    for version in sorted(spoken.get(bus.robot, set()) - {keys.PREFIX}):
        lines.append(
            f"somebody of robot {bus.robot!r} speaks {version}, which nobody hears who speaks {keys.PREFIX}: "
            "bring all machines to one version of Engage"
        )
    _say(lines, tell)
    return set(absent)


def _say(lines: Iterable[str], tell: Tell | None) -> None:
    for line in lines:
        LOG.warning("%s", line)
        if tell is not None:
            tell(line)


async def _hint(bus: Bus, connect: Sequence[str], wanted: Collection[str], tell: Tell | None) -> None:
    """Tell who is missing, and of each as soon as it is in sight after all: then what was told does not hold."""
    missing = await tell_who_is_missing(bus, connect, wanted, tell=tell)
    while missing:
        await asyncio.sleep(LOOK)
        if here := missing & set(bus.health.peers):
            _say([f"in sight now: {', '.join(sorted(here))}"], tell)
            missing -= here


def _way_in(robot: str, connect: Sequence[str]) -> str:
    starts = f"`engage up --robot {robot}` starts one"
    if any(map(is_encrypted, connect)):
        return (
            f"{starts}; if one runs, the router lets in only --keys that it knows, and shows nothing to revoked ones"
        )
    return starts


def unseen(absent: Iterable[str], statuses: Iterable[Status], host: str = "") -> list[Unseen]:
    """Participants that are not in sight here, with what others tell of them. host: name of this machine."""
    known = list(statuses)
    return [
        Unseen(
            name,
            tuple(sorted(each.participant for each in known if name in each.bus.peers)),
            tuple(
                sorted(
                    {
                        place
                        for each in known
                        for there in each.bus.reachable
                        if there.participant == name
                        for place in there.endpoints
                    }
                )
            ),
            any(name in each.bus.peers and each.process.host == host != "" for each in known),
        )
        for name in absent
    ]


def told(missing: Sequence[Unseen]) -> list[str]:
    """Lines about participants that are not in sight: one for each that others see, one for all the rest."""
    lines = []
    for name, seen_by, places, is_near in missing:
        if not seen_by:
            continue
        if is_near and any(map(is_on_this_machine, places)):
            lines.append(f"{name} is not in sight, though {', '.join(seen_by)} can see it; waiting")
            continue
        if places and all(map(is_on_this_machine, places)):
            why = f"it listens on {', '.join(_host(place) for place in places)} only; {REMEDY}"
        elif places:
            why = f"it listens on {', '.join(places)}, which cannot be reached from here"
        else:
            why = "it is a client of a router that this process has no link to"
        lines.append(f"{name} cannot be seen from here, though {', '.join(seen_by)} can see it: {why}")
    if nowhere := [each.name for each in missing if not each.seen_by]:
        lines.append(f"nobody here sees {', '.join(nowhere)}; waiting")
    return lines


def _host(place: str) -> str:
    return place.partition("/")[2].rpartition(":")[0]


async def _statuses(bus: Bus) -> list[Status]:
    """Status of each service that is in sight."""
    there = [name for name in bus.health.peers if name in keys.ROLES and name != bus.name]
    answers = await asyncio.gather(
        *(bus.query(keys.status(name), AskStatus(), LOOK) for name in there), return_exceptions=True
    )
    return [each for each in answers if isinstance(each, Status)]


async def robots(connect: Sequence[str]) -> tuple[str, ...]:
    """Names of the robots on the bus, in order; without endpoints: on this machine's. Raises nothing."""
    return tuple(sorted(name for name, spoken in (await versions(connect)).items() if keys.PREFIX in spoken))


async def versions(connect: Sequence[str]) -> dict[str, set[str]]:
    """Versions of the protocol that are spoken, by robot; without endpoints: on this machine. Raises nothing."""
    if any(map(is_encrypted, connect)):
        return {}  # a link without keys is refused there
    try:
        session, _ = open_session(None, connect or (RENDEZVOUS,), (), None)
    except EngageError:
        return {}
    try:
        found: dict[str, set[str]] = {}
        until = asyncio.get_running_loop().time() + LOOK
        while not found and asyncio.get_running_loop().time() < until:  # the link itself takes a moment
            await asyncio.sleep(POLL)
            replies = session.liveliness().get(f"*/{keys.ANY_PROTOCOL}", timeout=LOOK)
            async for key in _keys(replies, until):
                robot, root, version, _ = key.split("/", 3)
                found.setdefault(robot, set()).add(f"{root}/{version}")
        return found
    finally:
        session.close()  # type: ignore[no-untyped-call]


async def protocols(session: zenoh.Session, timeout: Seconds) -> tuple[str, ...]:
    """Versions of the protocol that processes of the session's robot speak, in order."""
    found: set[str] = set()
    until = asyncio.get_running_loop().time() + timeout
    replies = session.liveliness().get(keys.ANY_PROTOCOL, timeout=timeout)
    async for key in _keys(replies, until):
        found.add("/".join(key.split("/")[:2]))
    return tuple(sorted(found))


async def _keys(replies: Any, until: Seconds) -> AsyncIterator[str]:
    while asyncio.get_running_loop().time() < until:
        try:
            reply = replies.try_recv()
        except zenoh.ZError:  # all have answered
            return
        if reply is None:
            await asyncio.sleep(POLL)
        elif reply.ok is not None:
            yield str(reply.ok.key_expr)
