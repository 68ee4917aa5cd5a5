"""The bus over Zenoh: a session shared by participants of one process; with keys, one for each of its services.

What the participants of a process say to one another goes in memory, whichever session is theirs, and to all other
processes over Zenoh: each reader gets a message once, for a session takes nothing from those of its own process.

Zenoh carries the messages. This module and `order` add what it leaves open: order across keys, history for late
subscribers, repair of losses in a cut, the list of participants, and questions that get no answer.
"""

import asyncio
import time
from collections.abc import Callable, Sequence
from importlib.metadata import version
from itertools import count
from math import inf
from pathlib import Path
from typing import Any

import msgspec
import zenoh

from engage_hri.schemas import access, keys
from engage_hri.schemas.faults import Fault, NotReady
from engage_hri.schemas.messages import Message, published
from engage_hri.schemas.participants import BusHealth, ProcessFacts
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.config import Mode, is_on_this_machine, mode_of
from engage_hri.services.bus.interface import LOG, Answer, Answering, Bus, Hub, Subscription, Tap
from engage_hri.services.bus.keyring import Expiry, Keys
from engage_hri.services.bus.zenoh.bridge import LoopBridge
from engage_hri.services.bus.zenoh.clocks import Clocks
from engage_hri.services.bus.zenoh.history import History, pack
from engage_hri.services.bus.zenoh.links import Links
from engage_hri.services.bus.zenoh.order import Envelope, SentLog, Written, mark_of
from engage_hri.services.bus.zenoh.peers import Peers
from engage_hri.services.bus.zenoh.questions import QuestionEnds
from engage_hri.services.bus.zenoh.readers import Readers
from engage_hri.services.bus.zenoh.rights import Rights, check_keys
from engage_hri.services.bus.zenoh.session import (
    LOOPBACK,
    PEER_AFAR,
    QOS,
    RENDEZVOUS,
    ROUTER_WITH_KEYS,
    RUST_PLACE,
    STREAM_QOS,
    open_client,
    open_session,
)

DECLARED = 256
"""Number of keys that are declared at a time: people and clients come and go, each with keys of its own."""


class Publishers:
    """Publishers of a session, by key, declared as they are needed."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._declared: dict[str, zenoh.Publisher] = {}

    def of(self, key: str, ordered: bool) -> zenoh.Publisher:
        """Return the publisher of a key. ordered: False for a stream."""
        publisher = self._declared.get(key)
        if publisher is None:
            if len(self._declared) >= DECLARED:
                self.drop(next(iter(self._declared)))
            qos = QOS if ordered else STREAM_QOS
            publisher = self._session.declare_publisher(key, allowed_destination=zenoh.Locality.REMOTE, **qos)
            self._declared[key] = publisher
        return publisher

    def drop(self, key: str) -> None:
        """Take back the declaration of a key, if there is one."""
        if (publisher := self._declared.pop(key, None)) is not None:
            publisher.undeclare()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        for key in tuple(self._declared):
            self.drop(key)


FIRST_TIME_SPACE = 0xEFFFFFFA
"""Number of the time namespace that Linux begins with."""
FIRST_PULSE: Seconds = 0.25
NEXT_PULSE: Seconds = 1.0
OPENING: Seconds = 0.5
"""Time that `open_hub` waits for the first other process: one that leaves before is heard by nobody."""
POLL: Seconds = 0.05
"""Time between two looks for a first link."""
VACANCY: Seconds = 4.0
"""Time that a dead participant may seem to be there: the lease of a silent link, and as long again."""
QUIET: Seconds = 0.25
"""Time without a change after which all peers are known, also those found through others."""


def own_clock(loop: asyncio.AbstractEventLoop, run: str) -> tuple[str, Callable[[], Seconds]]:
    """Name of the clock that loop time is, and how to read it: the machine's, one since boot, or the loop's own.

    uvloop tells time in whole milliseconds, as of when its turn began: too coarse to measure by. A machine has more
    than one such clock if its containers have time namespaces.
    """
    boot, space = Path("/proc/sys/kernel/random/boot_id"), Path("/proc/self/ns/time")
    if abs(loop.time() - time.monotonic()) < 0.1 and boot.exists():
        number = space.stat().st_ino if space.exists() else FIRST_TIME_SPACE
        more = "" if number == FIRST_TIME_SPACE else f"-{number}"
        return f"boot-{boot.read_text()[:8]}{more}", time.monotonic
    return f"loop-{run[:8]}", loop.time


async def open_hub(
    robot: str,
    *,
    connect: Sequence[str] = (),
    listen: Sequence[str] = (),
    mode: Mode = "auto",
    rendezvous: str | None = RENDEZVOUS,
    keys: Keys | None = None,
    beside: "Hub | None" = None,
    patience: Seconds = inf,
) -> "ZenohHub":
    """Join the bus of `robot`. Processes may start in any order: this waits for others for `OPENING` at most.

    A client waits for a router, at most for `patience`.

    connect, listen: Zenoh endpoints (`tcp/HOST:PORT`). Without any, the processes of this machine find one another
    at `rendezvous`. keys: those of this process; it is then a client of a router, with its holder's role and name.
    beside: a hub of this process, on Zenoh too: its participants and those of the new one hear each other in memory.
    Raises InputRefused when an endpoint is misspelled or does not go with the keys, RunFailed when it is taken,
    NotReady when patience has an end and there is no link to anybody by then.
    """
    until = asyncio.get_running_loop().time() + patience
    if keys is not None:
        connect = connect or (ROUTER_WITH_KEYS,)
        check_keys(keys, robot, connect, listen, mode)
    # Both block the loop for a moment, before its work has started: Zenoh has no async API, and we start no thread.
    places: tuple[str, ...] = ()
    if keys is not None or mode_of(mode, connect, listen) == "client":
        session, calls = await open_client(robot, connect, keys, patience), True
    else:
        session, calls = open_session(robot, connect, listen, None if connect or listen else rendezvous)
        places = tuple(listen) or (LOOPBACK,)
        if not all(map(is_on_this_machine, connect)):
            LOG.warning("%s", PEER_AFAR)
    link = ProcessFacts(
        zenoh=version("eclipse-zenoh"), mode="peer" if places else "client", connect=tuple(connect),
        holder=keys.holder.common_name if keys else "", until=keys.holder.until if keys else None,
    )  # fmt: skip
    rights = Rights(keys.holder) if keys is not None else None
    hub = ZenohHub(robot, session, places, rights, link, beside if isinstance(beside, ZenohHub) else None)
    if calls and beside is None:
        await hub.peers.wait_for_discovery(asyncio.get_running_loop().time() + OPENING)
    if patience < inf and not await hub.is_linked(until):
        await hub.close()
        reason = f"no process answers at {', '.join(connect or [rendezvous or ''])}"
        advice = "`engage up` starts a robot; --connect has the endpoint of one that runs, or of its router"
        raise NotReady(Fault(reason=reason, advice=advice))
    return hub


class ZenohHub(Hub):
    """The hub of a process on a Zenoh session."""

    def __init__(
        self,
        robot: str,
        session: zenoh.Session,
        places: Sequence[str] = (),
        rights: Rights | None = None,
        link: ProcessFacts | None = None,
        beside: "ZenohHub | None" = None,
    ) -> None:
        """places: endpoints at which others may connect to this process. rights: those of its keys, if it has any.

        link: how it came to the bus. beside: see `open_hub`.
        """
        self.robot = robot
        self._link = link or ProcessFacts()
        self.rights = rights
        self.run = str(session.zid())
        self.session = session
        self.bridge = LoopBridge(self.failed)
        self.life_numbers = count(1)
        self._loop = asyncio.get_running_loop()
        self.clocks = Clocks(*own_clock(self._loop, self.run))
        self._sent = SentLog(self.run)
        self.process: list[ZenohHub] = [] if beside is None else beside.process
        """The hubs of this process, this one among them."""
        self._logs: dict[str, SentLog] = {} if beside is None else beside._logs
        """What the sessions of this process have published, by run; of one that is closed nothing."""
        self.process.append(self)
        self._logs[self.run] = self._sent
        self._publishers = Publishers(session)
        self._source = zenoh.SourceInfo(session.id, 0)
        self._buses: dict[str, ZenohBus] = {}
        self._pulse: asyncio.TimerHandle | None = None
        self._closed = False
        self.peers = Peers(
            session, self.bridge, self._sent, self.clocks, self._logs, places,
            access.rank if rights is not None else None,
        )  # fmt: skip
        for bus in (each for hub in self.process for each in hub.shown):
            self.peers.participants.setdefault((bus.part, bus.name), set()).add(bus.run)
        self._history = History(session, self.bridge, self._sent)
        trusts = rights.trusts if rights else None
        self.readers = Readers(session, self.bridge, self._sent, self.peers, self._history, self._logs, trusts)
        self.peers.stand(self.readers.publisher_came, self.readers.participant_changed)
        self._links = Links(session, self.bridge, self._link.connect, LOG.warning)
        until = self._link.until
        self._expiry = Expiry(self._link.holder, until, LOG.warning) if until is not None else None

    @property
    def unlinked_at(self) -> Seconds:
        return self._links.unlinked_at

    async def is_linked(self, until: Seconds) -> bool:
        """Tell whether there is a link to another process; waits for one until then."""
        info: Any = self.session.info
        while not info.links() and self._loop.time() < until:
            await self.peers.change(self._loop.time() + POLL)
        return bool(info.links())

    @property
    def health(self) -> BusHealth:
        """Figures of the process, without those of its participants."""
        traffic = self.bridge.traffic
        return BusHealth(
            peers=tuple(sorted(self.peers.names)), reachable=self.peers.reachable, clocks=self.clocks.offsets,
            refused=self.readers.refused, passed=traffic.passed, dropped=traffic.dropped, depth=traffic.depth,
            lag=traffic.lag, waiting=self.bridge.waiting,
        )  # fmt: skip

    def facts(self) -> ProcessFacts:
        own = super().facts()
        return msgspec.structs.replace(
            self._link, host=own.host, python=own.python, loop=own.loop, wall=own.wall
        )  # fmt: skip

    def called(self, name: str) -> str:
        return name if self.rights is None else self.rights.called(name)

    def join(self, name: str, role: str = "") -> "ZenohBus":
        name, role = self.called(name), role if self.rights is None else self.rights.holder.role
        if name in self._buses:
            raise ValueError(f"participant {name!r} is on the bus already")
        self._buses[name] = bus = ZenohBus(self, name, role)
        self.readers.viewer = next(iter(self._buses))
        return bus

    async def wait_until_free(self, *names: str) -> None:
        for name in names:
            self.peers.see(keys.alive(name, keys.part_of(access.role_of(name))))
        await self.peers.wait_for_quiet(QUIET)
        deadline = self._loop.time() + VACANCY
        while taken := sorted(set(names) & self.peers.names.keys()):
            if not await self.peers.change(deadline):
                reason = f"robot {self.robot!r} has {'this' if len(taken) == 1 else 'these'} on the bus already"
                advice = "stop what runs there, or give this one another --robot or another endpoint"
                raise NotReady(Fault(reason=reason, where=", ".join(taken), advice=advice))

    def forget(self, name: str) -> None:
        self._buses.pop(name, None)

    @property
    def shown(self) -> "list[ZenohBus]":
        """Participants that show their token."""
        return [bus for bus in self._buses.values() if bus.is_shown]

    def note(self, bus: "ZenohBus", there: bool) -> None:
        """Note in all of this process that a participant of this session has come or gone."""
        for hub in self.process:
            hub.peers.note(bus.part, bus.name, self.run, there)

    def server(self, key: str) -> Answering | None:
        """The answers of the participant in this process that serves the key, if there is one."""
        buses = (bus for hub in self.process for bus in hub._buses.values())
        return next((bus.questions.here for bus in buses if key in bus.questions.here.served), None)

    def failed(self, error: Exception, what: str) -> None:
        """Tell an error that cannot be assigned to a participant: the first one of the process tells it."""
        if (bus := next(iter(self._buses.values()), None)) is not None:
            bus.failed(error, what)
        else:
            LOG.error("%s: %s", what, error, exc_info=error)

    async def close(self) -> None:
        if self._closed:
            return
        for bus in list(self._buses.values()):
            await bus.leave()
        await self.peers.flush()
        self._closed = True
        self.process.remove(self)
        self._logs[self.run] = SentLog(self.run)
        self.bridge.close()
        if self._pulse is not None:
            self._pulse.cancel()
        if self._expiry is not None:
            self._expiry.close()
        self._links.close()
        self.readers.close()
        self._history.close()
        self.peers.close()
        self._publishers.close()
        try:
            self.session.close()  # type: ignore[no-untyped-call]
        except zenoh.ZError as error:  # a link that is stuck at the other end: all that is ours has been given back
            LOG.warning("the bus could not be closed in time: %s", RUST_PLACE.sub("", str(error)))

    # -- publishing ---------------------------------------------------------------------------------------------

    def publish(self, bus: "ZenohBus", key: str, message: Message) -> None:
        if self.rights is not None:
            self.rights.check(bus.name, "publishes", key)
        ordered = keys.key_class(key) != "stream"
        now = self._loop.time()
        payload, encoding = published(key, message)
        stamp = self.session.new_timestamp()
        if ordered:
            self._history.begin(keys.flow_of(key))
            written = self._sent.write(key, encoding, payload, bus.name, self.clocks.own, now, stamp)
            if self._pulse is None:
                self._pulse = self._loop.call_later(FIRST_PULSE, self._send_pulse)
        else:
            written = Written(key, encoding, payload, Envelope(bus.name, self.clocks.own, now, mark=mark_of(key)))
        attachment = pack(written.envelope)
        self._publishers.of(key, ordered).put(
            payload, encoding=encoding, attachment=attachment, timestamp=stamp, source_info=self._source
        )
        for hub in self.process:
            hub.readers.offer(written, message, self.run)

    def withdraw(self, key: str) -> None:
        """Forget a state that this process has published."""
        self._sent.withdraw(key)
        self._publishers.drop(key)

    def is_heard(self, key: str) -> bool:
        """Tell whether anybody has subscribed to `key`, as far as Zenoh knows."""
        status: Any = self._publishers.of(key, keys.key_class(key) != "stream").matching_status  # its stub says bool
        return status.matching or any(hub.readers.want(key) for hub in self.process)

    def _send_pulse(self) -> None:
        """Publish the recent counts, a few times: they show a receiver that it lost the last message of a burst."""
        recent = self._sent.recent(self._loop.time())
        self._pulse = self._loop.call_later(NEXT_PULSE, self._send_pulse) if recent else None
        if recent:
            for flow, counts in recent.items():
                pulse = self._publishers.of(keys.own(self.run, f"pulse/{flow}"), True)
                # With its sender it takes its turn behind the messages that it counts, and makes nobody ask for them.
                pulse.put(pack(counts), encoding="application/msgpack", source_info=self._source)


class ZenohBus(Bus):
    """A participant's view of the bus over Zenoh."""

    def __init__(self, hub: ZenohHub, name: str, role: str) -> None:
        super().__init__(hub.robot, name, role, hub.clocks.own, hub.run, hub.life_numbers)
        self._hub = hub
        self.questions = QuestionEnds(self, hub.session, hub.bridge, hub.peers, hub.server)
        self._token: Any = None

    @property
    def unlinked_at(self) -> Seconds:
        return self._hub.unlinked_at

    @property
    def health(self) -> BusHealth:
        gaps, lost = self._hub.readers.missed(self)
        return msgspec.structs.replace(
            self._hub.health, overflowed=self.overflowed, gaps=gaps, lost=lost, failures=self.failures
        )

    def local(self, stamp: Stamp) -> Seconds:
        return self._hub.clocks.local(stamp)

    def error(self, clock: str) -> Seconds:
        return self._hub.clocks.error(clock)

    def _send(self, key: str, message: Message) -> None:
        if not self._gone:
            self._hub.publish(self, key, message)

    def withdraw(self, *states: str) -> None:
        for key in states:
            self._hub.withdraw(key)

    def is_heard(self, key: str) -> bool:
        return self._hub.is_heard(key)

    def _attach(self, reader: Subscription | Tap) -> None:
        if self._hub.rights is not None:
            for pattern in reader.patterns:
                self._hub.rights.check(self.name, "subscribes", pattern)
        self._hub.readers.attach(self, reader)

    def _detach(self, reader: Subscription | Tap) -> None:
        self._hub.readers.detach(reader)

    async def _query(self, key: str, message: Message, deadline: Seconds) -> Message | None:
        if self._hub.rights is not None:
            self._hub.rights.check(self.name, "asks", key)
        return await self.questions.query(key, message, deadline)

    def answer(self, key: str, answer: Answer, *, empty: Message | None = None) -> None:
        self.questions.serve(key, answer, empty)

    def declare_alive(self) -> None:
        if self._token is None and not self._gone:
            token = keys.own(self._hub.run, f"alive/{self.part}/{self.name}/{self.clock}")
            self._token = self._hub.session.liveliness().declare_token(token)
            self._hub.note(self, True)

    @property
    def is_shown(self) -> bool:
        """True while this participant's token is there."""
        return self._token is not None and not self._gone

    async def leave(self) -> None:
        if self._gone:
            return
        self._gone = True
        for reader in tuple(self._readers):
            reader.close()
        self.questions.close()
        if self._token is not None:
            self._token.undeclare()
            self._hub.note(self, False)
        self._hub.forget(self.name)
