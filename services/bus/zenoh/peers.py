"""Peers on the bus, and the questions of processes to one another: for the time, and for a flush.

A process gets the tokens of those whom it needs to know, and of nobody else: of the robot's participants, of those
whose presence its own participants subscribe to, and of processes with a past of the flows that they read. Zenoh
selects by the key. If all got all tokens, those of N clients would cost the router N times N.
"""

import asyncio
import re
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from typing import Any, TypeVar

import msgspec
import zenoh

from engage_hri.schemas import keys
from engage_hri.schemas.participants import Reachable
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.zenoh.bridge import LoopBridge
from engage_hri.services.bus.zenoh.clocks import REFRESH, Clocks
from engage_hri.services.bus.zenoh.history import BAD, finish, pack
from engage_hri.services.bus.zenoh.order import Counts, SentLog, mark_of
from engage_hri.services.bus.zenoh.session import QOS

FLUSH: Seconds = 2.0
"""Time that closing waits until the others have everything: as long as a silent one counts as alive."""
CLOCK_TRIPS = 5
CLOCK_TIMEOUT: Seconds = 1.0

Key = TypeVar("Key")
Item = TypeVar("Item")
_instants = msgspec.msgpack.Decoder(Stamp)


class Peers:
    """Liveliness and the questions between processes.

    Of all that is in sight: participants: part and name of each, with the runs that have it. processes: runs of
    their processes. publishers: runs that have a past to hand out, and its flows.
    """

    def __init__(
        self,
        session: zenoh.Session,
        bridge: LoopBridge,
        sent: SentLog,
        clocks: Clocks,
        own: Collection[str],
        places: Sequence[str] = (),
        rank: Callable[[str], int] | None = None,
    ) -> None:
        """own: runs of this process, of which the hub tells. places: endpoints at which others may connect to it.

        rank: of the process with this run, by its keys: the lowest is believed what time its machine has.
        """
        self.participants: dict[tuple[keys.Part, str], set[str]] = {}
        self.processes: dict[str, set[str]] = {}
        self.publishers: dict[str, set[keys.Flow]] = {}
        own_places = {_without_settings(place) for place in places}
        self._places: dict[str, set[str]] = {sent.run: own_places} if own_places else {}
        """For each process, where others may connect to it; of a client nothing."""
        self.clocks = clocks
        self._loop = asyncio.get_running_loop()
        self._session = session
        self._bridge = bridge
        self._sent = sent
        self._watchers: list[asyncio.Future[None]] = []
        self._clock_of: dict[str, str] = {}
        """Clocks of the processes that are there, those that came first first."""
        self._own = own
        self._rank = rank or (lambda run: 0)
        self._measuring = self._loop.call_later(REFRESH, self._measure_clocks)
        self._watched: dict[str, Any] = {}
        """Subscribers to tokens, by the expression for them."""
        self._declared: tuple[Any, ...] = (
            session.declare_queryable(keys.own(sent.run, "clock"), bridge.questions(self._tell_time)),
        )

    def stand(
        self,
        on_publisher: Callable[[str, keys.Flow], None],
        on_participant: Callable[[keys.Part, str, str, bool], None],
    ) -> None:
        """Watch for the others, and show where the own process listens, now that it can answer.

        on_publisher: called with the run of a process that has published on this flow for the first time, or come
        back. on_participant: called with part, name and run of a participant, and with True if it has come, False if
        it has gone.
        """
        self._on_publisher = on_publisher
        self._on_participant = on_participant
        self.see(keys.ANY_ROBOT_ALIVE)
        if places := self._places.get(self._sent.run):
            self._watch(keys.own("*", "at/*/*"))
            token = self._session.liveliness().declare_token
            self._declared += tuple(token(keys.own(self._sent.run, f"at/{place}")) for place in sorted(places))

    def see(self, presence: str) -> None:
        """Watch for the participants of this expression for their presence, from now on."""
        self._watch(keys.tokens(presence))

    def hear(self, flow: keys.Flow) -> None:
        """Watch for processes with a past of this flow, from now on."""
        self._watch(keys.own("*", f"log/{flow}"))

    def _watch(self, tokens: str) -> None:
        if not any(keys.includes(known, tokens) for known in self._watched):
            handler = self._bridge.on_loop(self._token_changed)
            self._watched[tokens] = self._session.liveliness().declare_subscriber(tokens, handler, history=True)

    @property
    def names(self) -> dict[str, set[str]]:
        """Names of participants, each with the runs that have it."""
        found: dict[str, set[str]] = {}
        for (_, name), runs in self.participants.items():
            found.setdefault(name, set()).update(runs)
        return found

    async def wait_for_discovery(self, deadline: Seconds) -> None:
        """Wait until the first other process is known."""
        while not (self.processes or self.publishers) and await self.change(deadline):
            pass

    async def wait_for_quiet(self, pause: Seconds) -> None:
        """Wait until no peer has come or gone for this long; returns at once if there is no link to anybody."""
        info: Any = self._session.info
        while info.links() and await self.change(self._loop.time() + pause):
            pass

    def close(self) -> None:
        self._measuring.cancel()
        for declared in (*self._watched.values(), *reversed(self._declared)):
            declared.undeclare()

    # -- liveliness ---------------------------------------------------------------------------------------------

    def _token_changed(self, sample: zenoh.Sample) -> None:
        chunks: list[Any] = str(sample.key_expr).split("/")[3:]
        run, subject = chunks[0], chunks[1:]
        there = sample.kind == zenoh.SampleKind.PUT
        if run in self._own:
            return
        match subject:
            case ["alive", part, name, clock]:
                _mark(self.processes, run, f"{part}/{name}", there)
                if there:
                    self._has_clock(run, clock)
                self.note(part, name, run, there)
            case ["log", flow]:
                _mark(self.publishers, run, flow, there)
                if there:
                    self._on_publisher(run, flow)
            case ["at", *place]:
                _mark(self._places, run, "/".join(place), there)
        if run not in self.processes and run not in self.publishers:
            self._clock_of.pop(run, None)
        self._wake_watchers()

    def heard(self, run: str, clock: str, sent: Seconds) -> None:
        """Take the time, by its clock, at which a process has sent what has just come."""
        if clock != self.clocks.own:
            if run in self.publishers:  # whose participants, and so its clock, need not be in sight
                self._has_clock(run, clock)
            self.clocks.heard(clock, sent, self._loop.time())

    def _has_clock(self, run: str, clock: str) -> None:
        if run not in self._clock_of:
            self._clock_of[run] = clock
            if clock != self.clocks.own and self._witness(clock) == run:
                self.measure_clock(run)

    def _witness(self, clock: str) -> str:
        """The process that is asked for this clock: of those that say that they have it the first that came.

        Anybody can say so. With keys those of the robot go before others.
        """
        return min((run for run, its in self._clock_of.items() if its == clock), key=self._rank, default="")

    @property
    def reachable(self) -> tuple[Reachable, ...]:
        """Participants, and the endpoints at which others may connect to their processes."""
        found = []
        for name, runs in sorted(self.names.items()):
            if places := {each for run in runs for each in self._places.get(run, ())}:
                found.append(Reachable(name, tuple(sorted(places))))
        return tuple(found)

    def note(self, part: keys.Part, name: str, run: str, there: bool) -> None:
        """Note that a participant has come or gone; the hub does so for those of the own process."""
        was_there = run in self.participants.get((part, name), ())
        _mark(self.participants, (part, name), run, there)
        if there != was_there and (there or (part, name) not in self.participants):
            self._on_participant(part, name, run, there)

    async def change(self, deadline: Seconds) -> bool:
        """Wait until a peer comes or goes; False at the deadline."""
        watcher: asyncio.Future[None] = self._loop.create_future()
        self._watchers.append(watcher)
        timer = self._loop.call_at(deadline, _resolve, watcher)
        try:
            await watcher
            return self._loop.time() < deadline
        finally:
            timer.cancel()
            if watcher in self._watchers:
                self._watchers.remove(watcher)

    def _wake_watchers(self) -> None:
        for watcher in self._watchers:
            _resolve(watcher)
        self._watchers.clear()

    # -- questions ----------------------------------------------------------------------------------------------

    def ask(
        self,
        key: str,
        payload: bytes,
        reply: Callable[[zenoh.Reply], None],
        end: Callable[[Any], None],
        timeout: Seconds,
        encoding: str | None = None,
    ) -> None:
        """Ask all matching servers; calls `reply` for each answer and then `end`, on the loop."""
        self._session.get(
            key,
            self._bridge.on_loop(reply, end),
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            payload=payload,
            encoding=encoding,
            attachment=pack(mark_of(key)),
            timeout=timeout,
            **QOS,
        )

    def _measure_clocks(self) -> None:
        """Read all clocks again: they drift apart. Of the processes of one machine one is asked."""
        self._measuring = self._loop.call_later(REFRESH, self._measure_clocks)
        for clock in set(self._clock_of.values()) - {self.clocks.own}:
            self.measure_clock(self._witness(clock))

    def measure_clock(self, run: str, trips: int = CLOCK_TRIPS) -> None:
        """Read the clock of a process in a few round trips."""
        asked = self.clocks.now()

        def reply(got: zenoh.Reply) -> None:
            answered = self.clocks.now()
            if got.ok is None:
                return
            with suppress(*BAD):
                told = _instants.decode(got.ok.payload.to_bytes())
                if self._witness(told.clock) != run:
                    return
                self.clocks.measured(told.clock, asked, told.seconds, answered)
                if trips > 1:
                    self.measure_clock(run, trips - 1)

        self.ask(keys.own(run, "clock"), b"", reply, lambda _: None, CLOCK_TIMEOUT)

    async def round_trip(self, run: str, timeout: Seconds) -> Seconds | None:
        """Time that a question to a process takes, and its answer; None: there was no answer in time."""
        answered: asyncio.Future[Seconds | None] = self._loop.create_future()
        asked = self.clocks.now()

        def reply(got: zenoh.Reply) -> None:
            if got.ok is not None and not answered.done():
                answered.set_result(self.clocks.now() - asked)

        def ended(_: Any) -> None:
            if not answered.done():
                answered.set_result(None)

        self.ask(keys.own(run, "clock"), b"", reply, ended, timeout)
        await asyncio.wait([answered], timeout=timeout)
        return answered.result() if answered.done() else None

    def _tell_time(self, query: zenoh.Query) -> None:
        query.reply(keys.own(self._sent.run, "clock"), pack(Stamp(self.clocks.own, self.clocks.now())))
        finish(query)

    async def flush(self) -> None:
        """Wait until all who read it have the last messages: an exit right after a put loses most of them."""
        recent = self._sent.recent(self._loop.time())
        await asyncio.gather(*(self._flush(flow, counts) for flow, counts in recent.items()))

    async def _flush(self, flow: keys.Flow, recent: Counts) -> None:
        done: asyncio.Future[None] = self._loop.create_future()
        question = pack((self._sent.run, recent))
        self.ask(keys.own("*", f"flush/{flow}"), question, lambda reply: None, lambda _: _resolve(done), FLUSH)
        await done


def _without_settings(endpoint: str) -> str:
    """The endpoint without what follows `?` or `#`, which cannot be in a key, or is of no use to others."""
    return re.split("[?#]", endpoint)[0]


def _mark(sets: dict[Key, set[Item]], key: Key, item: Item, there: bool) -> None:
    """Put the item into the set of this key, or take it out. An empty set is dropped."""
    if there:
        sets.setdefault(key, set()).add(item)
    elif key in sets:
        sets[key].discard(item)
        if not sets[key]:
            del sets[key]


def _resolve(future: "asyncio.Future[None]") -> None:
    if not future.done():
        future.set_result(None)
