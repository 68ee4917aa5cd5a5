"""Perception by a program: it tells a robot of a person, by the protocol that cameras and microphones speak.

    async with perceive("ann") as ann:
        await ann.look_at("cup")
        await ann.say("That one?")

For those who write cameras and recognizers, for tests, and for windows in which somebody plays the person.
"""

import asyncio
import uuid
from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager

from engage_hri.schemas import keys as bus_keys
from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.schemas.participants import PeerAlive
from engage_hri.schemas.units import Seconds, Vector
from engage_hri.services.bus.config import Mode
from engage_hri.services.bus.interface import Bus, Hub, Subscription
from engage_hri.services.client.people.perceived_person import PerceivedPerson
from engage_hri.services.runtime.configuration import bus_config

PATIENCE: Seconds = 3.0
"""Time that the robot has to be there."""
LOOK_AROUND: Seconds = 0.5
"""Time in which the world, if anybody tells it, is known."""
ANSWERED: Seconds = 0.1
"""Silence after which all have said what they know of the world."""
TELLERS = ("perception", "wizard")
"""Roles that may tell what people do."""


@asynccontextmanager
async def perceive(
    person: str,
    *,
    position: Vector | None = None,
    robot: str | None = None,
    connect: Sequence[str] = (),
    mode: Mode | None = None,
    listen: Sequence[str] = (),
    hub: Hub | None = None,
    name: str = "",
    keys: str = "",
    timeout: Seconds | None = PATIENCE,
) -> AsyncIterator[PerceivedPerson]:
    """Tell a robot of a person: who comes with the beginning of `async with`, and leaves with its end.

    The person is put into the world, unless somebody else tells of it there already.

    person: actor id.
    position: of the face, metres in the robot's frame; None: opposite the robot, beside others.
    robot: the robot's namespace on the bus; what is not given is taken from the environment, as `connect` does.
    connect: Zenoh endpoints to connect to; none: this machine's.
    mode: client of a router, or peer; auto: client if an endpoint is on another machine.
    listen: Zenoh endpoints to listen on.
    hub: use this one instead; it stays open.
    name: the participant's, unique on the robot's bus; made up when empty.
    keys: folder of keys that `engage keys` has made, of a holder with the role perception.
    timeout: seconds that the robot's recognition has to be there; None: for ever.

    Raises:
        InputRefused: the keys are those of another role, or no good; or the id can be no person's, for it is the
            robot's, or that of a thing of the world.
        RunFailed: no robot is there within `timeout`.
        ValueError: a name that cannot be in a key, or that the hub has already.
    """
    check_id(person, "all")
    async with AsyncExitStack() as stack:
        if hub is None:
            hub = await stack.enter_async_context(
                await _opened(robot=robot, connect=tuple(connect), mode=mode, listen=listen, keys=keys)
            )
        check_id(person, hub.robot)
        bus = hub.join(name or f"perceive-{uuid.uuid4().hex[:8]}", role="perception")
        stack.push_async_callback(bus.leave)
        told = PerceivedPerson(person, bus)
        inbox = stack.enter_context(bus.subscribe(bus_keys.ANY_ROBOT_ALIVE, bus_keys.WORLD))
        bus.declare_alive()
        await _robot_there(bus, inbox, told, timeout)
        if position is None and told._entity(person) is None:
            await _all_answered(bus, inbox, told)
        told._enter(position)
        listening = asyncio.create_task(_listen(bus, inbox, told), name=f"world around {person}")
        try:
            yield told
        finally:
            listening.cancel()
            await asyncio.gather(listening, return_exceptions=True)
            while len(inbox):  # what others have said of the world is not to be said again as it was
                told._take(await inbox.next())
            told._leaves()


async def _opened(
    *, robot: str | None, connect: tuple[str, ...], mode: Mode | None, listen: Sequence[str], keys: str
) -> Hub:
    # Only here: a program on an existing hub needs no Zenoh.
    from engage_hri.services.bus.keyring import read_keys
    from engage_hri.services.bus.zenoh.hub import open_hub

    bus = bus_config(robot=robot, connect=connect, mode=mode, keys=keys)
    own = read_keys(bus.keys, "perception") if bus.keys else None
    if own is not None and own.holder.role not in TELLERS:
        reason = f"these keys have the role {own.holder.role}; what people do is told by {' or '.join(TELLERS)}"
        raise InputRefused(Fault(reason=reason, where=bus.keys, advice="`engage keys add --help`"))
    return await open_hub(bus.robot, connect=bus.connect, listen=listen, mode=bus.mode, keys=own)


async def _robot_there(bus: Bus, inbox: Subscription, told: PerceivedPerson, timeout: Seconds | None) -> None:
    """Wait for recognition, and then for the world, if anybody tells it. Raises RunFailed."""
    deadline = None if timeout is None else bus.now() + timeout
    is_there = False
    while not (is_there and told.world):
        received = await inbox.next(deadline)
        if received is not None:
            told._take(received)
        elif is_there:
            return  # nobody tells a world
        else:
            reason, advice = f"no robot {bus.robot!r} here within {timeout} s", "`engage up` starts one"
            raise RunFailed(Fault(reason=reason, where="recognition", advice=advice))
        if isinstance(received.message, PeerAlive) and received.message.participant == "recognition":
            is_there, deadline = True, bus.now() + LOOK_AROUND


async def _all_answered(bus: Bus, inbox: Subscription, told: PerceivedPerson) -> None:
    """Wait until all have said what they know of the world: in an old one a seat seems free that is taken."""
    until = bus.now() + LOOK_AROUND
    while (received := await inbox.next(min(until, bus.now() + ANSWERED))) is not None:
        told._take(received)


async def _listen(bus: Bus, inbox: Subscription, told: PerceivedPerson) -> None:
    while not inbox.is_over:
        received = await inbox.next(told._deadline)
        with bus.containing(received or "what is due by now"):
            told._take(received)


def check_id(person: str, other: str) -> None:
    """Refuse what can be no person's id. other: an id that is taken, as the robot's. Raises InputRefused."""
    if not bus_keys.is_chunk(person) or person == other:
        advice = f"a person's id has {bus_keys.CHUNK}, and is not {other!r}"
        raise InputRefused(Fault(reason=f"{person!r} can't be a person's id", advice=advice))
