"""The plain example tells what Engage's own client tells, whatever happens to the link. Nothing here has a wire."""

import math
from functools import partial
from itertools import count
from typing import Any

import msgspec
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.recognition import ENDINGS, ConnectionEvent, OpenEvents
from engage_hri.schemas.units import Stamp
from engage_hri.services.client.event_stream import EventStream
from engage_hri.services.recognition.events.open_events import OpenEventTracker
from tests.random_cases import share_of
from tests.test_examples import example

plain = example("plain_zenoh_events")
COURSES = (("started", "succeeded", "completed"), ("started", "failed"))


class Link:
    """A recognition, and behind one link Engage's own reader and the plain one. Timestamps are whole numbers."""

    def __init__(self) -> None:
        self.now, self.here = 0.0, True
        self.lives, self.ids = count(1), count(1)
        self.ours = EventStream(0.0, partial(Stamp, "loop"))
        self.told: list[tuple[str, str, str]] = []
        self.plainly_told: list[tuple[str, str, str]] = []
        self.plain = plain.Changes(
            lambda event: self.plainly_told.append((event["id"], event["state"], event.get("words", "")))
        )
        self.open: dict[int, tuple[str, list[str]]] = {}
        self.start()
        self.join()

    def start(self) -> None:
        """Another life of recognition, which knows nothing of the former, on a machine whose clock is behind."""
        self.life = f"life{next(self.lives)}"
        self.stamps = count(1)
        self.book = OpenEventTracker("robot", self.life)
        self.published: list[tuple[float, int, ConnectionEvent | OpenEvents]] = []
        self.missed: list[ConnectionEvent | OpenEvents] = []
        self.open.clear()
        self.last: dict[int, ConnectionEvent] = {}
        """Last event of each slot, as it was told."""

    def step(self, slot: int, late: bool = False) -> None:
        """The event of this slot goes on: the even ones are ann's, the odd ones bob's.

        late: it still comes through, although it is known already that recognition is away; not once its events are
        lost, which is seconds later.
        """
        late = late and not self.missed and self.life == self.plain.life and self.plain.deadline is not None
        id, states = self.open.get(slot) or (f"{self.life}-dg-{next(self.ids)}", list(COURSES[slot // 2 % 2]))
        known = self.last.get(slot) if slot in self.open else None
        event = ConnectionEvent(
            id=id, kind="directed_gaze", initiator="robot", responder=("ann", "bob")[slot % 2], state=states[0],  # type: ignore[arg-type]
            at=Stamp("loop", self.now), started=Stamp("loop", 0.0), words=known.words if known else "",
        )  # fmt: skip
        self.open[slot] = (id, states[1:])
        if event.state in ENDINGS:
            del self.open[slot]
        self._tell(slot, event, late)

    def words(self, slot: int) -> None:
        """The words of this slot's last event become known, or others than before."""
        if slot in self.last:
            words = f"words {next(self.ids)}"
            self._tell(slot, replace(self.last[slot], words=words, retold=True, at=Stamp("loop", self.now)))

    def _tell(self, slot: int, event: ConnectionEvent, late: bool = False) -> None:
        self.last[slot] = event
        for message in (event, *self.book.feed([event], event.at)):
            self.published.append((self.now, next(self.stamps), message))
            if not (self.here or late):
                self.missed.append(message)
                continue
            self.told += heard(self.ours.feed(message, self.now, self.now))
            if isinstance(message, ConnectionEvent):
                self.plain.hear(news(*self.published[-1]))

    def cut(self) -> None:
        if self.here:
            self.here = False
            self.told += heard(self.ours.feed(PeerGone(participant="recognition"), self.now, self.now))
            self.plain.went(self.life, self.now)

    def join(self, early: bool = False, age: float = math.inf) -> None:
        """early: a change comes by itself before it is known that recognition is there again. age: asked for."""
        self.here = True
        self.told += heard(self.ours.feed(PeerAlive(participant="recognition", run=self.life), self.now, self.now))
        for message in self.missed:
            self.told += heard(self.ours.feed(message, self.now, self.now))
        self.missed.clear()
        changes = [one for one in self.published if isinstance(one[2], ConnectionEvent) and one[0] >= self.now - age]
        states = {one[2].actor: one for one in self.published if isinstance(one[2], OpenEvents)}
        if early and changes:
            self.plain.hear(news(*changes[-1]))
        self.plain.came(self.life, [news(*one) for one in (*states.values(), *changes)])

    def wait(self, seconds: float) -> None:
        end = self.now + seconds
        for reader, expire in ((self.ours, self._expire), (self.plain, self.plain.lose)):
            if reader.deadline is not None and reader.deadline <= end:
                expire()
        self.now = end

    def _expire(self) -> None:
        assert self.ours.deadline is not None
        self.told += heard(self.ours.expire(self.ours.deadline))

    def restart(self) -> None:
        self.cut()
        self.start()


def heard(events: list[ConnectionEvent]) -> list[tuple[str, str, str]]:
    return [(event.id, event.state, event.words) for event in events]


def news(at: float, stamp: int, message: ConnectionEvent | OpenEvents) -> Any:
    person = message.actor if isinstance(message, OpenEvents) else message.responder
    return plain.News(stamp, person, msgspec.json.decode(msgspec.json.encode(message)))


STEP = st.tuples(st.just("step"), st.integers(0, 3), st.booleans())
STEPS = st.one_of(
    STEP, STEP, STEP, STEP,
    st.tuples(st.just("words"), st.integers(0, 3)),
    st.tuples(st.just("wait"), st.sampled_from([0.5, 1.0, 5.0])),
    st.tuples(st.just("cut")),
    st.tuples(st.just("join"), st.booleans()),
    st.tuples(st.just("restart")),
)  # fmt: skip


@settings(max_examples=share_of(500))
@given(st.lists(STEPS, min_size=8, max_size=30))
def test_it_tells_what_the_client_tells_through_cuts_and_restarts(steps: list[tuple[Any, ...]]):
    link = Link()
    for what, *how in steps:
        if what != "join" or not link.here:
            getattr(link, what)(*how)
    if not link.here:
        link.join()

    assert link.plainly_told == link.told


def test_of_a_cut_longer_than_it_asks_for_it_tells_what_is_still_open_and_what_is_not():
    link = Link()
    for slot in (0, 2):
        link.step(slot)
    link.cut()
    link.wait(1.0)
    link.step(0)  # succeeded
    link.step(2)  # failed
    link.step(1)
    link.wait(70.0)
    before = len(link.plainly_told)
    link.step(3)
    link.join(age=60.0)

    first, second = "life1-dg-1", "life1-dg-2"
    told = [event[:2] for event in link.plainly_told]
    assert told[:before] == [(first, "started"), (second, "started"), (first, "lost"), (second, "lost")]
    assert set(told[before:]) == {
        (first, "started"), (second, "started"), (first, "succeeded"), (second, "lost"),
        ("life1-dg-3", "started"), ("life1-dg-4", "started"),
    }  # fmt: skip


def test_another_kind_is_neither_told_nor_missed():
    told: list[Any] = []
    changes = plain.Changes(told.append, "directed_gaze")
    event = {"id": "life-dg-1", "kind": "directed_gaze", "initiator": "ann", "responder": "robot", "state": "started"}
    other = {**event, "id": "life-ap-1", "kind": "adjacency_pair"}
    state = {"type": "open_events", "session": "life", "events": [event, other]}

    changes.came("life", [plain.News(1, "ann", state)])
    assert told == [event]

    changes.went("life", 1.0)
    changes.lose()
    assert [each["state"] for each in told] == ["started", "lost"]
