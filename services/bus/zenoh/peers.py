"""Peers on the bus, and the questions of processes to one another: for the time, and for a flush."""

import asyncio
import re
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from typing import Any

import msgspec
import zenoh

from engage_hri.schemas import keys
from engage_hri.schemas.status import Reachable
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.zenoh.clocks import REFRESH, Clocks
from engage_hri.services.bus.zenoh.history import BAD, finish, pack
from engage_hri.services.bus.zenoh.order import SentLog
from engage_hri.services.bus.zenoh.session import QOS, LoopBridge

FLUSH: Seconds = 2.0
"""Time that closing waits until the others have everything: as long as a silent one counts as alive."""
CLOCK_TRIPS = 5
CLOCK_TIMEOUT: Seconds = 1.0

_instants = msgspec.msgpack.Decoder(Stamp)


class Peers:
    """Liveliness and the questions between processes.

    processes: runs of the processes that are there. publishers: of those that have a past to hand out. names:
    participants, each with the runs that have it. changes: number of times that a peer has come or gone.
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
        self.processes: set[str] = set()
        self.publishers: set[str] = set()
        self.names: dict[str, set[str]] = {}
        self.changes = 0
        self._places: dict[str, set[str]] = {sent.run: {_without_settings(place) for place in places}}
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
        self._declared: tuple[Any, ...] = (
            session.declare_queryable(keys.own(sent.run, "clock"), bridge.questions(self._tell_time)),
        )

    def stand(self, on_publisher: Callable[[str], None], on_participant: Callable[[str, str, bool], None]) -> None:
        """Watch for the others, and show the own process' token, now that it can answer.

        on_publisher: called with the run of a process that has published for the first time, or come back.
        on_participant: called with name and
        run of a participant, and with True if it has come, False if it has gone.
        """
        self._on_publisher = on_publisher
        self._on_participant = on_participant
        liveliness = self._session.liveliness()
        handler = self._bridge.on_loop(self._token_changed)
        self._declared += (
            liveliness.declare_subscriber(keys.ANY_TOKEN, handler, history=True),
            *(
                liveliness.declare_token(keys.own(self._sent.run, f"at/{place}"))
                for place in sorted(self._places[self._sent.run])
            ),
            liveliness.declare_token(keys.own(self._sent.run, f"process/{self.clocks.own}")),
        )

    async def wait_for_discovery(self, deadline: Seconds) -> None:
        """Wait until the first other process is known."""
        while not self.processes and await self.change(deadline):
            pass

    async def wait_for_quiet(self, pause: Seconds) -> None:
        """Wait until no peer has come or gone for this long; returns at once without any other process."""
        while self.processes and await self.change(self._loop.time() + pause):
            pass

    def close(self) -> None:
        self._measuring.cancel()
        for declared in reversed(self._declared):
            declared.undeclare()

    # -- liveliness ---------------------------------------------------------------------------------------------

    def _token_changed(self, sample: zenoh.Sample) -> None:
        run, *subject = str(sample.key_expr).split("/")[3:]
        there = sample.kind == zenoh.SampleKind.PUT
        if run in self._own:
            return
        if subject[:1] == ["process"] and len(subject) == 2:
            if there:
                self.processes.add(run)
                self._clock_of[run] = subject[1]
                if subject[1] != self.clocks.own and self._witness(subject[1]) == run:
                    self.measure_clock(run)
            else:
                self.processes.discard(run)
                self._clock_of.pop(run, None)
        elif subject == ["log"]:
            (self.publishers.add if there else self.publishers.discard)(run)
            if there:
                self._on_publisher(run)
        elif subject[:1] == ["at"]:
            places, place = self._places.setdefault(run, set()), "/".join(subject[1:])
            (places.add if there else places.discard)(place)
            if not places:
                del self._places[run]
        elif len(subject) == 2 and subject[0] == "alive":
            self.note(subject[1], run, there)
        self.wake_watchers()

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

    def note(self, name: str, run: str, there: bool) -> None:
        """Note that a participant has come or gone; the hub does so for those of the own process."""
        runs = self.names.setdefault(name, set())
        if there and run not in runs:
            runs.add(run)
            self._on_participant(name, run, True)
        elif not there and run in runs:
            runs.discard(run)
            if not runs:
                self._on_participant(name, run, False)
        if not runs:
            del self.names[name]

    async def change(self, deadline: Seconds, since: int | None = None) -> bool:
        """Wait until a peer comes or goes; False at the deadline. since: return at once if `changes` is past it."""
        if since is not None and self.changes > since:
            return True
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

    def wake_watchers(self) -> None:
        """Let all who wait for a change look again."""
        self.changes += 1
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
        query.reply(query.key_expr, pack(Stamp(self.clocks.own, self.clocks.now())))
        finish(query)

    async def flush(self) -> None:
        """Wait until all known processes have the last messages: an exit right after a put loses most of them."""
        recent = self._sent.recent(self._loop.time())
        if recent and self.processes:
            done: asyncio.Future[None] = self._loop.create_future()
            question = pack((self._sent.run, recent))
            self.ask(keys.ANY_FLUSH, question, lambda reply: None, lambda _: _resolve(done), FLUSH)
            await done


def _without_settings(endpoint: str) -> str:
    """The endpoint without what follows `?` or `#`, which cannot be in a key, or is of no use to others."""
    return re.split("[?#]", endpoint)[0]


def _resolve(future: "asyncio.Future[None]") -> None:
    if not future.done():
        future.set_result(None)
