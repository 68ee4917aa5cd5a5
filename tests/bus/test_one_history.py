"""Random stories of processes that come, go and crash, of losses and of lies, against what each reader must see.

The oracle knows only what was published when, by whom, and when each reader came. Both buses play the same stories;
losses, slow wires and lies about the order are Zenoh's alone, for memory has no wire.
"""

import asyncio
import random
from collections import defaultdict, deque
from typing import Any, NamedTuple

import pytest
import zenoh

from engage_hri.schemas import keys
from engage_hri.schemas.messages import encode, encoding_of
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus, Subscription
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.bus.zenoh.bridge import Arrived
from engage_hri.services.bus.zenoh.history import pack
from engage_hri.services.bus.zenoh.hub import ZenohHub
from engage_hri.services.bus.zenoh.order import Envelope
from engage_hri.services.bus.zenoh.session import open_session
from tests.bus.places import PATIENCE, MemoryPlace, Place, ZenohPlace, state, take
from tests.random_cases import share_of

pytestmark = pytest.mark.each_bus(shared=False)
EVENTS = (keys.FEEDBACK, keys.BLOCK, keys.request_state("realizer"))
KEYS = (*EVENTS, keys.WORLD)
HEARD = (("engage/v1/**",), KEYS, ("engage/v1/evt/**", keys.WORLD), (keys.FEEDBACK, "engage/v1/*/realizer/**"))
SURE: Seconds = 1.0
"""Age up to which an event is in the history of a reader that comes, however slow this machine is."""


class Said(NamedTuple):
    number: int
    key: str
    at: Seconds


class Speaker:
    """A life of a process with one participant. end: how it ended; empty while it lives."""

    def __init__(self, hub: Any, bus: Bus) -> None:
        self.hub = hub
        self.bus = bus
        self.said: list[Said] = []
        self.end = ""


class Reader(NamedTuple):
    inbox: Subscription
    came: Seconds


class Story:
    def __init__(self, place: Place, seed: int, loss: float) -> None:
        self.place = place
        self.chance = random.Random(seed)
        self.drops = random.Random(f"{seed} drops")
        self.loss = loss
        self.speakers: list[Speaker] = []
        self.readers: list[Reader] = []
        self.liar: Any = None
        self.lies: list[Speaker] = []
        """Whom each lie is told of; the first is message -1."""
        self.count = 0

    @property
    def living(self) -> list[Speaker]:
        return [speaker for speaker in self.speakers if not speaker.end]

    async def start(self) -> None:
        hub = await self.place.process()
        bus = hub.join(f"speaker-{len(self.speakers)}")
        bus.declare_alive()
        self.speakers.append(Speaker(hub, bus))
        if isinstance(hub, ZenohHub):
            self._make_wire_bad(hub)

    def _make_wire_bad(self, hub: ZenohHub) -> None:
        """Lose what is published at times before any reader of this process gets it, or delay it for one sender."""
        came, loop = hub.readers._sample_came, asyncio.get_running_loop()
        wires: dict[str, deque[tuple[str, Arrived]]] = defaultdict(deque)

        def arrive(sender: str) -> None:
            came(*wires[sender].popleft())

        def sample_came(pattern: str, sample: Arrived) -> None:
            if self.drops.random() < self.loss:
                return
            wire = wires[sample.sender]
            late = self.drops.choice((0.0, 0.0, 0.0, 0.01))
            if not wire and not late:
                came(pattern, sample)
                return
            wire.append((pattern, sample))
            loop.call_later(late, arrive, sample.sender)

        hub.readers._sample_came = sample_came  # type: ignore[method-assign]

    def publish(self) -> None:
        speaker, key = self.chance.choice(self.living), self.chance.choice(KEYS)
        self.count += 1
        speaker.said.append(Said(self.count, key, speaker.bus.now()))
        speaker.bus.publish(key, state(self.count))

    def join(self) -> None:
        bus = self.chance.choice(self.living).bus
        self.readers.append(Reader(bus.subscribe(*self.chance.choice(HEARD), capacity=10**6), bus.now()))

    def leave(self) -> None:
        if self.readers:
            self.readers.pop(self.chance.randrange(len(self.readers))).inbox.close()

    async def end(self, how: str) -> None:
        if len(self.living) < 2:
            return
        speaker = self.chance.choice(self.living)
        speaker.end = how
        self.readers = [reader for reader in self.readers if not self._is_at(reader, speaker)]
        if how == "leaves":
            await (speaker.bus.leave() if isinstance(self.place, MemoryPlace) else speaker.hub.close())
        elif isinstance(speaker.hub, MemoryHub):
            speaker.hub.kill(speaker.bus.name)
        else:
            crash(speaker.hub)
            await self._die_with(speaker.hub)
        if isinstance(self.place, ZenohPlace):
            self.place._hubs.remove(speaker.hub)

    async def _die_with(self, hub: ZenohHub) -> None:
        """End the others of its process, too."""
        for other in [each for each in self.living if each.hub in hub.process]:
            other.end = "crashes"
            self.readers = [reader for reader in self.readers if not self._is_at(reader, other)]
            crash(other.hub)
            self.place._hubs.remove(other.hub)  # type: ignore[union-attr]
        if not self.living:
            await self.start()

    def _is_at(self, reader: Reader, speaker: Speaker) -> bool:
        return reader.inbox in getattr(speaker.bus, "_readers")  # noqa: B009

    def lie(self) -> None:
        """Publish in the name of a process, at a place of its order that it has not come to yet."""
        if not isinstance(self.place, ZenohPlace):
            return
        victim, key = self.chance.choice(self.living), self.chance.choice(KEYS)
        if self.liar is None:
            self.liar, _ = open_session(victim.hub.robot, [self.place._rendezvous], [], None)
        nth = victim.hub._sent.counts.get(key, 0) + self.chance.choice([1000, 10**9])
        envelope = Envelope(victim.bus.name, victim.bus.clock, victim.bus.now(), self.chance.randrange(10**9), nth)
        self.lies.append(victim)
        lie = state(-len(self.lies))
        self.liar.put(
            key, encode(lie), encoding=encoding_of(lie), attachment=pack(envelope),
            source_info=zenoh.SourceInfo(victim.hub.session.id, 0),
        )  # fmt: skip

    async def play(self, steps: int) -> None:
        await self.start()
        await self.start()
        for _ in range(steps):
            what = ("publish", "join", "leave", "crashes", "leaves", "start", "lie", "pause")
            match self.chance.choices(what, (50, 8, 3, 1, 1, 2, 8, 10))[0]:
                case "publish":
                    self.publish()
                case "join":
                    self.join()
                case "leave":
                    self.leave()
                case "start":
                    await self.start()
                case "lie":
                    self.lie()
                case "pause":
                    await asyncio.sleep(self.chance.choice([0.0, 0.02]))
                case how:
                    await self.end(how)

    async def judge(self) -> None:
        """Raises AssertionError."""
        self.join()
        for speaker in self.living:  # the last word of each, on each key
            for key in KEYS:
                self.count += 1
                speaker.said.append(Said(self.count, key, speaker.bus.now()))
                speaker.bus.publish(key, state(self.count))
        for reader in self.readers:
            self._judge(reader, await self._read(reader))

    async def _read(self, reader: Reader) -> list[int]:
        """All that comes until the last words of all who live are there."""
        numbers: list[int] = []
        missing = {self._last(speaker, key) for speaker in self.living for key in EVENTS if reader.inbox.wants(key)}
        if reader.inbox.wants(keys.WORLD):
            missing.add(self._last_world)
        while missing:
            [received] = await take(reader.inbox)
            if received.key in KEYS:
                numbers.append(int(received.message.id))  # type: ignore[union-attr]
                # Who has ended can't say any more what he never said.
                assert numbers[-1] > 0 or self.lies[-numbers[-1] - 1].end, "believed a lie"
                missing.discard(numbers[-1])
        return numbers

    @property
    def _last_world(self) -> int:
        """The state that counts in the end: of several who publish it, the one who was last."""
        return max(self._last(speaker, keys.WORLD) for speaker in self.living)

    def _last(self, speaker: Speaker, key: str) -> int:
        return max(said.number for said in speaker.said if said.key == key)

    def _judge(self, reader: Reader, got: list[int]) -> None:
        worlds = {said.number for speaker in self.speakers for said in speaker.said if said.key == keys.WORLD}
        assert not reader.inbox.wants(keys.WORLD) or [each for each in got if each in worlds][-1] == self._last_world
        for speaker in self.speakers:
            known = {said.number: said for said in speaker.said}
            heard = [known[number] for number in got if number in known]
            by_key = defaultdict(list)
            for said in heard:
                by_key[said.key].append(said)
            if not self.loss:
                assert heard == sorted(heard), "out of order across keys"
            for key in filter(reader.inbox.wants, KEYS):
                self._judge_key(reader, speaker, key, by_key[key])

    def _judge_key(self, reader: Reader, speaker: Speaker, key: str, heard: list[Said]) -> None:
        said = [each for each in speaker.said if each.key == key]
        assert heard == sorted(set(heard)), "twice, or out of order"
        if key == keys.WORLD:  # the last of all counts, see `_judge`
            return
        if speaker.end == "crashes":
            # What was lost on the wire died with it; else what came is all between two moments.
            assert self.loss or not heard or heard == said[said.index(heard[0]) : said.index(heard[-1]) + 1]
        elif not speaker.end:
            since = next((each for each in said if each.at > reader.came - SURE), None)
            first = min((said.index(each) for each in (since, *heard[:1]) if each is not None), default=0)
            assert since is None or heard == said[first:], "something is missing"


def crash(hub: ZenohHub) -> None:
    """End a process as SIGKILL would: nobody is told, nothing is waited for."""
    hub._closed = True
    hub.bridge.close()
    if hub._pulse is not None:
        hub._pulse.cancel()
    hub.readers._readers.clear()  # it asks nothing any more
    hub.session.close()  # type: ignore[no-untyped-call]


@pytest.mark.parametrize(("seed", "loss"), [(seed, loss) for seed in range(share_of(6, 3)) for loss in (0.0, 0.2)])
async def test_each_reader_sees_what_it_must_whoever_comes_goes_crashes_or_lies(place: Place, seed: int, loss: float):
    story = Story(place, seed, loss)
    try:
        async with asyncio.timeout(PATIENCE):
            await story.play(120)
            await story.judge()
    finally:
        if story.liar is not None:
            story.liar.close()
