"""Trial of services in this process: one attack, and a report on it. On a memory bus and in virtual time only.

    report = run(Attack(seed=7), services)
    assert not report.wrong

The attack is drawn from its seed alone: the same seed gives the same attack.
"""

import asyncio
import logging
import traceback
from collections import Counter
from collections.abc import Awaitable, Callable, Mapping
from functools import partial
from random import Random
from typing import Any, Literal, get_args

from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.messages import decode, encode, encode_json
from engage_hri.schemas.participants import AskStatus, Status
from engage_hri.schemas.requests import Cancel
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.bus.interface import LOG, Hub, Received, Sample
from engage_hri.services.bus.memory import MemoryBus, MemoryHub
from engage_hri.services.bus.samples import read_payload
from engage_hri.services.requests.ends import Requester
from engage_hri.services.runtime.service import Service, serve
from engage_hri.services.runtime.virtual_time import Deadlock, TimeRanOut, VirtualTimeLoop
from tests.rigs.hostile.audit import REFUSED, Audit, Entry
from tests.rigs.hostile.payloads import Payload, Payloads
from tests.rigs.hostile.schemes import Move, Schemer
from tests.rigs.hostile.service import NAME as BODY
from tests.rigs.hostile.service import LyingBody
from tests.rigs.hostile.typed import RandomMessages, Words
from tests.rigs.hostile.visitor import NAME as VISITOR
from tests.rigs.hostile.visitor import Visitor, client_fault

Kind = Literal["messages", "requests", "body"]
KINDS: tuple[Kind, ...] = get_args(Kind)
Client = Callable[[Hub], Awaitable[None]]
SETTLE: Seconds = 100.0
"""Time after the attack: longer than all time limits in a row, so that a request still open then never ends."""
QUIET: Seconds = 10.0
"""Time at the end of `SETTLE` in which no service may mention old requests any more."""
LIMIT: Seconds = 3600.0
PEERS = 2
MOST_NAMED = 5
"""Most mistakes of one kind that a report names."""


class Attack(Struct, frozen=True, kw_only=True):
    """An attack to be made. seconds: its length, in virtual time. rate: random messages per second.

    own_body: the body under test is behind the real control: it is cut off at times, but no lying body replaces it.
    """

    seed: int = 0
    kinds: tuple[Kind, ...] = KINDS
    seconds: Seconds = 20.0
    rate: float = 20.0
    own_body: bool = False


class Report(Struct, kw_only=True):
    """Report on an attack. counts: of all that was sent and done. wrong: mistakes of the services, in words."""

    attack: Attack
    counts: Counter[str]
    wrong: list[str]
    failures: list[str]
    """Tracebacks of unexpected exceptions."""


def run(attack: Attack, services: Mapping[str, Service], client: Client | None = None) -> Report:
    """Make a trial on a virtual loop of its own, for a caller without one."""
    try:
        with asyncio.Runner(loop_factory=partial(VirtualTimeLoop, LIMIT)) as runner:
            return runner.run(trial(attack, services, client))
    except (Deadlock, TimeRanOut) as hang:
        return Report(attack=attack, counts=Counter(), wrong=[f"it hangs: {hang}"], failures=[])


async def trial(attack: Attack, services: Mapping[str, Service], client: Client | None = None) -> Report:
    """Run the services under the attack, let them settle, and judge. client: one under test, which has to end, too.

    Raises InputRefused if time is real: what is sent here is no good for motors.
    """
    if not isinstance(asyncio.get_running_loop(), VirtualTimeLoop):
        advice = "`run` brings its own loop"
        raise InputRefused(Fault(reason="the hostile peer runs in virtual time only", advice=advice))
    return await _Trial(attack, services, client).judged()


class _AuditedHub(MemoryHub):
    """A memory bus that has each message audited."""

    def __init__(self, services: frozenset[str]) -> None:
        super().__init__()
        self.audit = Audit()
        self.words = Words()
        self._services = services

    def _pass_on(self, sender: str, received: Received, sample: Sample) -> None:
        key, message = received.key, received.message
        self.words.hear(message)
        server = keys.server_of(key)
        arrives = server in self.alive and not self._is_cut(sender, server)
        is_foreign = sender not in self._services
        now = self._loop.time()
        self.audit.hear(key, message, sender, received.life, now, arrives=arrives, is_foreign=is_foreign)
        super()._pass_on(sender, received, sample)


class _FailureLog(logging.Handler):
    """Collects the tracebacks of contained failures."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.found: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.found.append(logging.Formatter().format(record))


class _Trial:
    def __init__(self, attack: Attack, services: Mapping[str, Service], client: Client | None) -> None:
        self.attack = attack
        self.client = client
        self.services = dict(services)
        self.hub = _AuditedHub(frozenset((*services, BODY, VISITOR)))
        self.counts: Counter[str] = Counter()
        self.wrong: list[str] = []
        self.failures: list[str] = []
        self.running: dict[str, asyncio.Task[None]] = {}
        self.peers: list[MemoryBus] = []
        self.entities: tuple[str, ...] = ("nobody",)

    def chance(self, of: str) -> Random:
        """Create the random numbers of one part of the attack: without that part the others stay the same."""
        return Random(f"{self.attack.seed}/{of}")

    # -- from beginning to end ------------------------------------------------------------------------------------

    async def judged(self) -> Report:
        before, log = asyncio.all_tasks(), _FailureLog()
        loop = asyncio.get_running_loop()
        LOG.addHandler(log)
        propagates, LOG.propagate = LOG.propagate, False
        loop.set_exception_handler(self._unhandled)
        try:
            async with self.hub:
                await self._run()
        finally:
            LOG.removeHandler(log)
            LOG.propagate = propagates
            loop.set_exception_handler(None)
        await asyncio.sleep(0)
        left = [task.get_name() for task in asyncio.all_tasks() - before if not task.done()]
        self._note("tasks left", left)
        self.failures += log.found
        self._note("contained failures", [_last_line(text) for text in self.failures])
        return Report(attack=self.attack, counts=self.counts, wrong=self.wrong, failures=self.failures)

    async def _run(self) -> None:
        if "body" in self.attack.kinds and not self.attack.own_body:
            self.services[BODY] = LyingBody(self.chance("lies")).serve
        for name in self.services:
            await self._start(name)
        await self._learn_world()
        bus = self.hub.join(VISITOR)
        servers = tuple(self.services)
        visitor = Visitor(self.chance("visitor"), self.entities, servers)
        async with Requester(bus) as requests:
            bus.declare_alive()
            clients = [] if self.client is None else [asyncio.ensure_future(self.client(self.hub))]
            async with asyncio.TaskGroup() as group:
                for part in self._parts(visitor, bus, requests):
                    group.create_task(part)
            await self._end_attack()
            await asyncio.sleep(SETTLE - QUIET)
            quiet_since = bus.now()
            for client in clients:
                self._note("clients that failed", list(filter(None, [await client_fault(client, QUIET, SETTLE)])))
            await asyncio.sleep(QUIET)
            await self._judge(bus, visitor, quiet_since)
        await bus.leave()
        for peer in self.peers:
            await peer.leave()
        for name in self.services:
            await self._stop(name)

    def _parts(self, visitor: Visitor, bus: MemoryBus, requests: Requester) -> list[Any]:
        attack = self.attack
        messages = RandomMessages(self.chance("typed"), self.hub.words)
        parts: list[Any] = []
        if "realizer" in self.services:
            parts.append(visitor.visit(bus, requests, attack.seconds))
        if "messages" in attack.kinds:
            parts.append(self._send_messages(Payloads(self.chance("payloads"), messages, self.entities)))
        if "requests" in attack.kinds:
            schemer = Schemer(self.chance("schemes"), messages, self.hub.words, self.entities, PEERS)
            parts.append(self._make_moves(schemer))
        if "body" in attack.kinds:
            parts.append(self._disrupt())
        return parts

    # -- services -------------------------------------------------------------------------------------------------

    async def _start(self, name: str) -> None:
        stands = asyncio.Event()
        serving = serve(self.hub, name, self.services[name], stands.set)
        self.running[name] = task = asyncio.create_task(serving, name=f"service {name}")
        standing = asyncio.create_task(stands.wait())
        await asyncio.wait([task, standing], return_when=asyncio.FIRST_COMPLETED)
        standing.cancel()
        if task.done():
            task.result()
            raise RuntimeError(f"service {name} ended before it stood")

    async def _stop(self, name: str) -> None:
        task = self.running[name]
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    async def _learn_world(self) -> None:
        bus = self.hub.join("witness")
        with bus.subscribe(keys.WORLD) as inbox:
            received = await inbox.next(bus.now() + 1.0)
        if received is not None and isinstance(received.message, World):
            self.entities = tuple(entity.id for entity in received.message.entities) or self.entities
        await bus.leave()

    def _unhandled(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        error = context.get("exception")
        trace = "".join(traceback.format_exception(error)) if isinstance(error, BaseException) else ""
        self.failures.append(f"{context.get('message')}\n{trace}".strip())

    # -- the attack -----------------------------------------------------------------------------------------------

    async def _send_messages(self, payloads: Payloads) -> None:
        chance, loop = self.chance("pauses"), asyncio.get_running_loop()
        until = loop.time() + self.attack.seconds
        while loop.time() < until:
            self.inject(payloads.next(loop.time()))
            await asyncio.sleep(chance.uniform(0.0, 2.0 / self.attack.rate))

    def inject(self, payload: Payload) -> None:
        self.counts["messages"] += 1
        try:
            read_payload(payload.data, payload.encoding, payload.key, "")
        except EngageError:
            self.counts["messages that were none"] += 1
        except Exception:
            pass  # reported below
        try:
            self.hub.inject(payload.key, payload.data, payload.encoding)
        except Exception as error:
            self.failures.append(f"{payload.kind} on {payload.key}\n{''.join(traceback.format_exception(error))}")

    async def _make_moves(self, schemer: Schemer) -> None:
        chance, loop = self.chance("scheming"), asyncio.get_running_loop()
        self.peers = [self._join(number) for number in range(PEERS)]
        until = loop.time() + self.attack.seconds
        async with asyncio.TaskGroup() as late:
            while loop.time() < until:
                late.create_task(self._make(schemer.next(loop.time())))
                await asyncio.sleep(chance.choice((0.0, chance.uniform(0.0, 0.2), chance.uniform(0.0, 2.0))))

    def _join(self, number: int) -> MemoryBus:
        bus = self.hub.join(f"mallory-{number}", role="manager")
        if self.chance(f"{bus.name}/{bus.run}").random() < 0.7:
            bus.declare_alive()
        return bus

    async def _make(self, move: Move) -> None:
        await asyncio.sleep(move.delay)
        peer = self.peers[move.peer]
        if move.message is None:
            self.counts["new lives of peers"] += 1
            await peer.leave()
            self.peers[move.peer] = self._join(move.peer)
            return
        is_command = move.expression.startswith(f"{keys.PREFIX}/cmd/")
        self.counts["bad commands" if is_command else "false answers"] += 1
        key = keys.command(move.expression, peer.role, peer.name) if is_command else move.expression
        try:
            encode(move.message)
        except (OverflowError, ValueError):
            return
        peer.publish(key, move.message)

    async def _disrupt(self) -> None:
        """Cut one participant off from all others, or have the body vanish and come back; again and again."""
        chance, loop = self.chance("cuts"), asyncio.get_running_loop()
        until = loop.time() + self.attack.seconds
        while True:
            await asyncio.sleep(chance.uniform(0.5, 8.0))
            if loop.time() >= until:
                return
            if chance.random() < 0.75:
                self.counts["cuts"] += 1
                self.hub.partition(chance.choice((*self.services, VISITOR)))
                await asyncio.sleep(chance.choice((0.5, 1.0, 4.0, chance.uniform(0.5, 20.0))))
                self.hub.heal()
            elif BODY in self.services:
                self.counts["vanished bodies"] += 1
                self.hub.kill(BODY)
                await self._stop(BODY)
                self.hub.audit.note_restart(BODY)
                await asyncio.sleep(chance.choice((0.0, 0.5, chance.uniform(0.0, 8.0))))
                await self._start(BODY)

    async def _end_attack(self) -> None:
        """Heal the bus, and cancel all that the peers have asked for."""
        self.hub.heal()
        await asyncio.sleep(1.0)
        for entry in self.hub.audit.open:
            if entry.is_foreign:
                self._cancel(entry)

    def _cancel(self, entry: Entry) -> None:
        name = entry.name
        role = entry.role if keys.is_chunk(entry.role) else "manager"
        requester = name.requester if keys.is_chunk(name.requester) else "mallory"
        cancel = Cancel(id=name.id, requester=name.requester, life=name.life, of=name.kind, reason="the end")
        key = keys.command(keys.cancel(name.server), role, requester)
        self.hub.inject(key, encode(cancel), "application/msgpack", entry.sender)

    # -- the verdict ----------------------------------------------------------------------------------------------

    async def _judge(self, bus: MemoryBus, visitor: Visitor, quiet_since: Seconds) -> None:
        audit = self.hub.audit
        self.counts["commands"] += audit.commands
        self.counts["answers"] += audit.answers
        self.counts["requests"] += len(audit.entries)
        self.counts["honest requests"] += len(visitor.asked)
        self.counts.update({f"honest: {end}": count for end, count in visitor.ends().items()})
        lies = "body" in self.attack.kinds and not self.attack.own_body
        judged = set(keys.SERVICES) & set(self.services) - ({BODY} if lies else set())
        ended = [f"{name}: {_end_of(task)}" for name, task in self.running.items() if task.done()]
        self._note("services that ended", ended)
        self._note("requests without outcome", visitor.hung)
        old = [entry for entry in audit.open if entry.asked_at < quiet_since and entry.name.server in judged]
        self._note("pending afterwards", [_described(entry) for entry in old])
        doubled = [_described(entry) for entry in audit.doubled if entry.name.server in judged]
        self._note("requests with two outcomes", doubled)
        self._note("still spoken of", [_described(entry) for entry in audit.lingering(quiet_since)])
        for name in self.services:
            await self._ask_status(bus, name)

    async def _ask_status(self, bus: MemoryBus, name: str) -> None:
        try:
            status = await bus.query(keys.status(name), AskStatus())
        except EngageError as error:
            self._note("services without status", [f"{name}: {error}"])
        else:
            assert isinstance(status, Status)
            self.counts["failures by status"] += status.bus.failures

    def _note(self, what: str, found: list[str]) -> None:
        self.counts[what] += len(found)
        self.wrong += [f"{what}: {each}" for each in found[:MOST_NAMED]]


def _described(entry: Entry) -> str:
    name = entry.name
    ends = ", then ".join(_readable(end) for end in entry.ends)
    return f"{name.kind} {name.id!r} of {name.requester!r} ({name.life!r}) at {name.server} {ends}".strip()


def _readable(end: bytes) -> str:
    return "refused" if end == REFUSED else encode_json(decode(end)).decode()[:300]


def _end_of(task: "asyncio.Task[None]") -> str:
    return "cancelled" if task.cancelled() else repr(task.exception())


def _last_line(text: str) -> str:
    return text.strip().rpartition("\n")[2]
