"""Delivers what arrives: to the right subscriptions, in order; asks for missing messages. On the loop."""

import asyncio
from collections.abc import Callable, Container, Mapping, Sequence
from functools import partial
from itertools import chain
from math import inf
from typing import Any

import msgspec
import zenoh

from engage_hri.schemas import keys
from engage_hri.schemas.faults import EngageError, Fault
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.requests import Unreadable
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus import journal
from engage_hri.services.bus.interface import LOG, Bus, Received, Sample, Subscription, Tap
from engage_hri.services.bus.samples import read_payload
from engage_hri.services.bus.subscription import offer_presence
from engage_hri.services.bus.zenoh.bridge import Arrived, LoopBridge
from engage_hri.services.bus.zenoh.history import BAD, PATTERNS, History, envelopes, finish, refuse
from engage_hri.services.bus.zenoh.order import (
    Counts,
    Envelope,
    Follower,
    Missing,
    NewestStates,
    Past,
    SentLog,
    Written,
    mark_of,
    may_skip,
    together,
)
from engage_hri.services.bus.zenoh.peers import Peers

_pulses = msgspec.msgpack.Decoder(Counts)
_flushes = msgspec.msgpack.Decoder(tuple[str, Counts])

Trusts = Callable[[str, str, str], bool]
"""Check of a message: the run of its process, its key, and the participant that it names."""
UNANSWERED: Seconds = 3.0
"""Time for which a process that does not answer is asked before what it has sent is let through. As long again, and
it is asked once more, as long as it is there: nobody else tells what was missed."""
PAUSE: Seconds = 0.2
"""Pause before it is asked again, the first; each is twice the one before. A question on a link that is broken ends
at once, and so would all that follow."""
CROWD = 64
"""Processes that are asked at once. Of those that come together the others follow, as many after each first pause, if
they are still there: who shows a thousand tokens of nobody is cut, and to ask for each of them takes seconds."""
LOOK: Seconds = 0.05
"""Time between two looks at the links. A look halts the loop, and takes longer than all else that a message costs."""
RUNS_KEPT = 256
"""Number of processes, there or gone, that a subscription remembers: one that is back gets on where it was."""


class _Reader:
    """A subscription of the participant `bus`, with its follower of each process, by run.

    kept: those of its patterns that have a past. flows: of these.
    """

    def __init__(self, bus: Bus, subscription: Subscription | Tap) -> None:
        self.bus = bus
        self.subscription = subscription
        self.kept = tuple(filter(keys.flows, subscription.patterns))
        self.flows = frozenset(flow for pattern in self.kept for flow in keys.flows(pattern))
        self.followers: dict[str, Follower] = {}
        self.newest = NewestStates()

    def follower(self, run: str, there: Container[str], now: Seconds) -> Follower:
        """The follower of a process, also of one that is new. there: processes that are not forgotten for it."""
        follower = self.followers.get(run)
        if follower is None:
            if len(self.followers) >= RUNS_KEPT and (gone := next((k for k in self.followers if k not in there), "")):
                del self.followers[gone]
            follower = self.followers[run] = Follower(self.subscription.patterns, now)
        return follower


class Readers:
    """All subscriptions of the process. refused: number of bad payloads. viewer: name for the log."""

    def __init__(
        self,
        session: zenoh.Session,
        bridge: LoopBridge,
        sent: SentLog,
        peers: Peers,
        history: History,
        own: Mapping[str, SentLog],
        trusts: Trusts | None = None,
    ) -> None:
        """own: what this process has published, by run: each of its hubs offers that to all, so Zenoh's copy is left.

        trusts: tells whether a message can be from its sender; None: whoever reaches the bus is believed."""
        self.refused = 0
        self.viewer = ""
        self._loop = asyncio.get_running_loop()
        self._session = session
        self._bridge = bridge
        self._sent = sent
        self._peers = peers
        self._history = history
        self._own = own
        self._trusts = trusts
        self._readers: list[_Reader] = []
        self._carriers: dict[str, tuple[Any, list[_Reader]]] = {}
        self._passing: set[str] = set()
        """Processes that pass on what others send, as of the last look."""
        self._looked_at: Seconds = -inf
        self._asking: dict[tuple[str, Seconds], list[tuple[_Reader, Follower]]] = {}
        """Who wants to ask a process that has never answered, and for how long."""
        self._flushing: list[tuple[str, keys.Flow, zenoh.Query]] = []
        self._decoded: tuple[Written, Message | None] | None = None
        self._flows: dict[keys.Flow, tuple[Any, ...]] = {}
        """What is declared for each flow that a subscription has asked for."""

    def missed(self, bus: Bus) -> tuple[int, int]:
        """Gaps of one participant, and the number of its messages that were lost for good."""
        followers = [one for reader in self._readers if reader.bus is bus for one in reader.followers.values()]
        return sum(one.gaps for one in followers), sum(one.lost for one in followers)

    def close(self) -> None:
        self._readers.clear()
        for declared in chain.from_iterable(self._flows.values()):
            declared.undeclare()

    def offer(self, written: Written, message: Message, run: str) -> None:
        """Deliver what this process has published itself. run: of the session."""
        envelope, now = written.envelope, self._loop.time()
        received = Received(written.key, message, envelope.source, now, life=run, number=envelope.number)
        for reader in self._readers:
            if not reader.subscription.wants(received.key):
                continue
            if isinstance(reader.subscription, Tap):
                reader.subscription.offer(_sample(written, run, now))
            else:
                if may_skip(written.key):
                    reader.newest.take(written, run, now)
                reader.subscription.offer(received)

    def want(self, key: str) -> bool:
        """Tell whether any subscription of this process wants `key`."""
        return any(reader.subscription.wants(key) for reader in self._readers)

    def attach(self, bus: Bus, subscription: Subscription | Tap) -> None:
        reader = _Reader(bus, subscription)
        self._readers.append(reader)
        for (part, name), runs in self._peers.participants.items():
            for run in sorted(runs):
                offer_presence(subscription, part, PeerAlive(participant=name, run=run), self._loop.time())
        oldest = self._loop.time() - keys.HISTORY_MAX_AGE
        past = (log.past(subscription.wants, Missing(), oldest) for log in self._own.values())
        ours = [(written, run) for run, each in zip(self._own, past, strict=True) for written in each.written]
        for written, run in sorted(ours, key=lambda one: one[0].envelope.sent):
            self._deliver(reader, written, run, past=True)
        for pattern in subscription.patterns:
            if presence := keys.presence(pattern):
                self._peers.see(presence)
            if keys.is_presence(pattern):  # on these keys nothing is published
                continue
            if pattern not in self._carriers:
                handler = self._bridge.samples(partial(self._sample_came, pattern))
                carrier = self._session.declare_subscriber(pattern, handler, allowed_origin=zenoh.Locality.REMOTE)
                self._carriers[pattern] = (carrier, [])
            self._carriers[pattern][1].append(reader)
        for run, flows in self._peers.publishers.items():
            if not flows.isdisjoint(reader.flows):
                self._ask(reader, run, self._follower(reader, run))
        for flow in reader.flows - self._flows.keys():
            self._begin(flow)

    def _begin(self, flow: keys.Flow) -> None:
        """Follow those who publish on this flow, from the first subscription to it on."""
        questions = self._bridge.questions(partial(self._flush_asked, flow))
        pulses = self._bridge.samples(partial(self._pulse_heard, flow))
        self._flows[flow] = (
            self._session.declare_queryable(keys.own(self._sent.run, f"flush/{flow}"), questions),
            self._session.declare_subscriber(keys.own("*", f"pulse/{flow}"), pulses),
        )
        self._peers.hear(flow)

    def detach(self, subscription: Subscription | Tap) -> None:
        self._readers = [reader for reader in self._readers if reader.subscription is not subscription]
        for pattern in subscription.patterns:
            carrier, readers = self._carriers.get(pattern, (None, []))
            readers[:] = [reader for reader in readers if reader.subscription is not subscription]
            if carrier is not None and not readers:
                del self._carriers[pattern]
                carrier.undeclare()

    def _follower(self, reader: _Reader, run: str) -> Follower:
        follower = reader.follower(run, self._peers.publishers, self._loop.time())
        follower.known = follower.known or run in self._peers.publishers
        return follower

    def _sample_came(self, pattern: str, sample: Arrived) -> None:
        if not sample.is_put:
            return
        key = sample.key
        run, envelope = self._origin(sample)
        if run in self._own:
            # Of this session, it is from outside in this process' own name; of another one it has come in memory.
            self.refused += run == self._sent.run
            return
        if envelope.mark not in (0, mark_of(key)):  # what is missing under its own key is asked for
            self.refused += 1
            return
        written = Written(key, sample.encoding, sample.payload, envelope)
        if not self._is_trusted(written, run):
            return
        self._peers.heard(run, envelope.clock, envelope.sent)
        for reader in tuple(self._carriers[pattern][1]) if pattern in self._carriers else ():
            # Only the first of overlapping patterns delivers, so that nothing comes twice.
            if reader.subscription.carrier(key) != pattern:
                continue
            if not envelope.number:
                self._deliver(reader, written, run, past=False)
                continue
            follower = self._follower(reader, run)
            for one in follower.take(written):
                self._deliver(reader, one, run, past=False)
            self._catch_up(reader, run, follower)
            if not follower.known and follower.held == 1:
                self._loop.call_later(UNANSWERED, self._give_up, reader, run, follower)

    def _is_trusted(self, written: Written, run: str) -> bool:
        """False for a message that its process may not send. One without an envelope is as good as its key."""
        envelope = written.envelope
        if self._trusts is None or not (envelope.clock or envelope.number):
            return True
        if self._trusts(run, written.key, envelope.source):
            return True
        self.refused += 1
        return False

    def _origin(self, sample: Arrived) -> tuple[str, Envelope]:
        """Run and envelope of a sample; an empty one where there is none, as programs in other languages send it.

        An envelope counts only together with Zenoh's word for who sent it, which every process of ours gives.
        """
        if sample.attachment is not None and sample.sender:
            try:
                return sample.sender, envelopes.decode(sample.attachment)
            except BAD:
                self.refused += 1
        return self._foreign_life(sample), Envelope("", "", 0.0)

    def _foreign_life(self, sample: Arrived) -> str:
        """Life of a program without an envelope, as far as Zenoh tells; else empty.

        A sample that the program has not stamped itself is stamped by the process that passes it on.
        """
        if sample.sender or not sample.stamped_by:
            return sample.sender
        stamped_by, now = sample.stamped_by, self._loop.time()
        if stamped_by not in self._passing and now - self._looked_at >= LOOK:
            self._looked_at, info = now, self._session.info
            self._passing = {*self._own, *map(str, info.routers_zid()), *map(str, info.peers_zid())}
        return "" if stamped_by in self._passing else stamped_by

    def _deliver(self, reader: _Reader, written: Written, run: str, *, past: bool) -> None:
        if isinstance(reader.subscription, Tap):
            reader.subscription.offer(_sample(written, run, self._loop.time(), past=past))
            return
        # One sample often has several readers: it is decoded once.
        if self._decoded is None or self._decoded[0] is not written:
            self._decoded = (written, self._decode(reader.bus, written, run))
        message = self._decoded[1]
        if isinstance(message, Unreadable) and reader.bus.name != keys.server_of(written.key):
            return
        if message is not None:
            envelope, now = written.envelope, self._loop.time()
            # A state that comes late is not to be the last word: another process may have said a newer one.
            if may_skip(written.key) and not reader.newest.take(written, run, min(now, self._sent_at(written))):
                return
            reader.subscription.offer(
                Received(written.key, message, envelope.source, now, past, run, envelope.number)
            )

    def _sent_at(self, written: Written) -> Seconds:
        return self._peers.clocks.local(Stamp(written.envelope.clock, written.envelope.sent))

    def _decode(self, bus: Bus, written: Written, run: str) -> Message | None:
        """Decode a message. A bad one is counted, and told as a fault; returns the notice for its server, if any."""
        try:
            return read_payload(written.payload, written.encoding, written.key, written.envelope.source)
        except EngageError as error:
            self.refused += 1
            return bus.unreadable(error, _sample(written, run, self._loop.time()))

    def _catch_up(self, reader: _Reader, run: str, follower: Follower) -> None:
        if follower.behind and not follower.asking and follower.known:
            self._ask(reader, run, follower)

    def _give_up(self, reader: _Reader, run: str, follower: Follower) -> None:
        """Drop what a process is said to have sent that has not shown itself: Zenoh tells of it before its messages.

        If it is there after all, its past has them.
        """
        if not follower.known:
            follower.drop()
            self._tell_forged(reader, run)

    def _tell_forged(self, reader: _Reader, run: str) -> None:
        LOG.warning("%s: dropped messages that say they are of %s, which never sent them", reader.bus.name, run)

    def _ask(self, reader: _Reader, run: str, follower: Follower, patience: Seconds = UNANSWERED) -> None:
        """Ask a process for what is missing. patience: time for which it is asked again if it does not answer.

        One that has never answered may be a mere token, of which there can be many: all who want something of it ask
        together.
        """
        follower.asking = True
        if not reader.kept:
            self._told(reader, run, follower, None)
        elif follower.has_answered:
            self._ask_for(run, [(reader, follower)], self._loop.time() + patience)
        else:
            if (run, patience) not in self._asking:
                pause = len(self._asking) // CROWD * PAUSE
                self._loop.call_later(pause, self._ask_together, run, patience)
            self._asking.setdefault((run, patience), []).append((reader, follower))

    def _ask_together(self, run: str, patience: Seconds) -> None:
        until, part, size = self._loop.time() + patience, list[tuple[_Reader, Follower]](), 0
        asking = self._asking.pop((run, patience))
        if run not in self._peers.publishers:
            for reader, follower in asking:
                self._told(reader, run, follower, None)
            return
        for one in asking:
            if part and size + len(one[0].kept) > PATTERNS:
                self._ask_for(run, part, until)
                part, size = [], 0
            part.append(one)
            size += len(one[0].kept)
        self._ask_for(run, part, until)

    def _ask_for(
        self, run: str, asking: Sequence[tuple[_Reader, Follower]], until: Seconds, pause: Seconds = PAUSE
    ) -> None:
        asking = [one for one in asking if one[0] in self._readers]
        if not asking:
            return
        is_answered, now = False, self._loop.time()

        def told(past: Past | None) -> None:
            nonlocal is_answered
            if not is_answered:
                is_answered = True
                for reader, follower in asking:
                    self._told(reader, run, follower, past)

        def ended(incomplete: Past | None) -> None:
            # It may be slow; or a link was cut, its own or ours, and it seems to be gone: the past is not lost yet.
            may_answer = run in self._peers.publishers or any(follower.has_answered for _, follower in asking)
            if not is_answered and may_answer and self._loop.time() < until:
                self._loop.call_later(pause, self._ask_for, run, asking, until, 2 * pause)
            else:
                told(incomplete)

        patterns = dict.fromkeys(pattern for reader, _ in asking for pattern in reader.kept)
        missing = together([follower.missing(now) for _, follower in asking])
        self._history.ask(tuple(patterns), run, missing, told, ended)

    def _told(self, reader: _Reader, run: str, follower: Follower, past: Past | None) -> None:
        follower.asking, known = False, follower.forged
        if past is not None:
            past = past.of(reader.subscription.wants)
            trusted = tuple(one for one in past.written if self._is_trusted(one, run))
            past = msgspec.structs.replace(past, written=trusted)
        for written, is_past in follower.catch_up(past):
            self._deliver(reader, written, run, past=is_past)
        if follower.forged > known:
            self._tell_forged(reader, run)
        if follower.again:
            follower.again, follower.behind = False, True
        self._catch_up(reader, run, follower)
        self._answer_flushes()
        if past is None and reader.kept:
            self._loop.call_later(UNANSWERED, self._ask_again, reader, run, follower)

    def _ask_again(self, reader: _Reader, run: str, follower: Follower) -> None:
        if reader in self._readers and run in self._peers.publishers and not follower.asking:
            follower.behind = True
            self._ask(reader, run, follower, patience=0.0)

    def publisher_came(self, run: str, flow: keys.Flow) -> None:
        for reader in self._readers:
            if flow not in reader.flows:
                continue
            follower = self._follower(reader, run)
            # The process may be back after a cut in which messages were lost, or the answer to a question.
            follower.again = follower.asking
            follower.behind = True
            self._catch_up(reader, run, follower)

    def _pulse_heard(self, flow: keys.Flow, sample: Arrived) -> None:
        run = keys.run_of(sample.key)
        try:
            pulse = _pulses.decode(sample.payload)
        except BAD:
            self.refused += 1
        else:
            self._compare(run, flow, pulse)

    def _compare(self, run: str, flow: keys.Flow, pulse: Counts) -> None:
        if run in self._own:
            return
        for reader in self._readers:
            if flow not in reader.flows:
                continue
            follower = self._follower(reader, run)
            follower.pulse(pulse)
            self._catch_up(reader, run, follower)

    def _flush_asked(self, flow: keys.Flow, query: zenoh.Query) -> None:
        try:
            run, pulse = _flushes.decode(query.payload.to_bytes() if query.payload else b"")
        except BAD as error:
            refuse(query, Fault(reason=str(error)), "json")
            finish(query)
            return
        self._compare(run, flow, pulse)
        self._flushing.append((run, flow, query))
        self._answer_flushes()

    def _answer_flushes(self) -> None:
        waiting = []
        for run, flow, query in self._flushing:
            readers = (each for each in self._readers if flow in each.flows and run in each.followers)
            if any(each.followers[run].behind for each in readers):
                waiting.append((run, flow, query))
            else:
                query.reply(keys.own(self._sent.run, f"flush/{flow}"), b"")
                finish(query)
        self._flushing = waiting

    def participant_changed(self, part: keys.Part, name: str, run: str, there: bool) -> None:
        message = PeerAlive(participant=name, run=run) if there else PeerGone(participant=name)
        journal.note_presence(message, self.viewer)
        for reader in self._readers:
            offer_presence(reader.subscription, part, message, self._loop.time())


def _sample(written: Written, run: str, now: Seconds, *, past: bool = False) -> Sample:
    sent = written.envelope
    return Sample(
        written.key, written.payload, written.encoding, sent.source, now, past, run,
        sent.number, sent.clock, sent.sent,
    )  # fmt: skip
