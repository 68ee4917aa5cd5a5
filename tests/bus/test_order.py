"""The numbering behind the Zenoh bus, without Zenoh: whatever the wire loses, repeats or reorders."""

from typing import Any

import msgspec
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas import keys
from engage_hri.schemas.access import BESIDE, SMALL
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.zenoh.order import PULSE_FOR, Envelope, Follower, Past, SentLog, Written, fitting
from tests.random_cases import share_of

KEYS = (keys.BLOCK, keys.FEEDBACK, keys.SYNC_POINT, keys.INHIBIT)
NUMBERS = st.integers(1, 10**9)
HEARD = (keys.BLOCK, "engage/v1/evt/**")


def write(sent: SentLog, key: str, now: float = 0.0) -> Written:
    return sent.write(key, "application/msgpack", b"", "there", "clock", now)


def answer(sent: SentLog, follower: Follower, now: Seconds = 0.0) -> Past:
    """The answer of a process to a follower of its."""
    missing = follower.missing(now)
    oldest = now - keys.HISTORY_MAX_AGE - missing.age
    return sent.past(lambda key: any(keys.matches(pattern, key) for pattern in follower.patterns), missing, oldest)


def numbers(written: list[Written]) -> list[int]:
    return [one.envelope.number for one in written]


class Wire:
    """From a sent to a follower, with the follower's questions answered when told to."""

    def __init__(self) -> None:
        self.sent = SentLog("run")
        self.follower = Follower(HEARD, 0.0)
        self.delivered: list[Written] = []
        self.expected: list[Written] = []

    def send(self, key: str, copies: int = 1) -> None:
        written = write(self.sent, key)
        if key == keys.INHIBIT:
            return
        self.expected.append(written)
        for _ in range(copies):
            self.delivered += self.follower.take(written)

    def pulse(self) -> None:
        for counts in self.sent.recent(0.0).values():
            self.follower.pulse(counts)

    def ask(self) -> None:
        if self.follower.behind:
            self.delivered += [one for one, _ in self.follower.catch_up(answer(self.sent, self.follower))]


@given(st.lists(st.tuples(st.sampled_from(KEYS), st.sampled_from([0, 1, 1, 2]), st.booleans(), st.booleans())))
@settings(max_examples=share_of(100), deadline=None)
def test_every_message_is_delivered_once_and_in_the_order_of_its_key_whatever_gets_lost(
    steps: list[tuple[str, int, bool, bool]],
):
    wire = Wire()

    for key, copies, pulse, ask in steps:
        wire.send(key, copies)
        if pulse:
            wire.pulse()
        if ask:
            wire.ask()
    wire.pulse()
    wire.ask()

    assert sorted(wire.delivered, key=lambda one: one.envelope.number) == wire.expected
    assert wire.follower.lost == 0
    for key in KEYS:
        assert [one for one in wire.delivered if one.key == key] == [one for one in wire.expected if one.key == key]


@given(st.lists(st.tuples(st.sampled_from(KEYS), st.booleans(), st.booleans())), st.integers(0, 10))
@settings(max_examples=100, deadline=None)
def test_what_a_cut_link_lost_comes_in_order_across_keys(steps: list[tuple[str, bool, bool]], joins_at: int):
    """A lost message closes the link, and a link that is back makes the follower ask before it delivers.

    The subscription is declared before the first question, on the same link: what comes after the answer arrives.
    """
    wire, was_cut = Wire(), False

    for step, (key, cut, ask) in enumerate(steps):
        if was_cut and not cut:
            wire.follower.behind = True
        was_cut = cut
        wire.send(key, copies=0 if cut or step < joins_at else 1)
        if ask and not cut and step >= joins_at:
            wire.ask()
    wire.follower.behind = True
    wire.ask()

    assert wire.delivered == wire.expected
    assert wire.follower.lost == 0


class Deceived(Wire):
    """The same, with messages that claim to be of this process, and an answer that may be on its way for a while."""

    def __init__(self) -> None:
        super().__init__()
        self.follower = Follower((*HEARD, keys.WORLD), 0.0)
        self.answer: Past | None = None
        self.lies: list[Written] = []

    def forge(self, key: str, ahead: int, number: int) -> None:
        """Claim a place in the order of the process."""
        nth = self.sent.counts.get(key, 0) + ahead
        lie = Written(key, "application/msgpack", b"lie", Envelope("there", "clock", 0.0, number, nth))
        self.lies.append(lie)
        self.delivered += self.follower.take(lie)

    def ask(self) -> None:
        if self.follower.behind and self.answer is None:
            self.answer = answer(self.sent, self.follower)

    def arrive(self) -> None:
        if self.answer is not None:
            self.delivered += [one for one, _ in self.follower.catch_up(self.answer)]
            self.answer = None

    def settle(self) -> None:
        self.arrive()
        self.pulse()
        for _ in range(2):  # what came under the first question is asked for with the second
            self.ask()
            self.arrive()


FORGED = st.sampled_from((keys.BLOCK, keys.FEEDBACK, keys.WORLD))
STEPS = st.one_of(
    st.tuples(st.just("send"), st.sampled_from((*KEYS, keys.WORLD)), st.sampled_from([0, 1, 1, 2])),
    st.tuples(st.just("forge"), FORGED, st.integers(100, 10**9), NUMBERS),
    st.tuples(st.just("claim"), FORGED, NUMBERS),
    st.tuples(st.sampled_from(["pulse", "ask", "arrive"])),
)


@given(st.lists(STEPS, max_size=60))
@settings(max_examples=share_of(300), deadline=None)
def test_whatever_others_claim_in_the_name_of_a_process_its_own_messages_come_once_and_in_order(steps: list[Any]):
    wire = Deceived()

    for what, *how in steps:
        match what:
            case "claim":
                key, nth = how
                wire.follower.pulse({key: nth})
            case _:
                getattr(wire, what)(*how)
    wire.settle()

    assert not wire.follower.behind
    assert wire.follower.lost == 0
    true = [one for one in wire.delivered if one.payload != b"lie"]
    for key in (keys.BLOCK, keys.FEEDBACK, keys.SYNC_POINT):
        assert [one for one in true if one.key == key] == [one for one in wire.expected if one.key == key]
    assert true == wire.delivered
    states = [one for one in wire.delivered if one.key == keys.WORLD]
    published = [one for one in wire.expected if one.key == keys.WORLD]
    assert states[-1:] == published[-1:] or not published


def test_of_two_messages_that_claim_one_place_the_published_one_is_delivered():
    for ahead in (1, 0):  # the lie comes before it, or after it
        wire = Deceived()
        wire.ask()
        wire.arrive()
        if ahead:
            wire.forge(keys.BLOCK, ahead, 999)
        wire.send(keys.BLOCK)
        if not ahead:
            wire.forge(keys.BLOCK, ahead, 999)
        wire.send(keys.BLOCK)
        wire.settle()

        assert wire.delivered == [*(wire.lies if ahead else ()), *wire.expected]
        assert wire.follower.lost == 0


@given(st.integers(1, 9), st.integers(1, 3), st.booleans())
def test_a_forged_state_lasts_until_the_next_pulse(ahead: int, published: int, goes_on: bool):
    wire = Deceived()
    wire.ask()
    wire.arrive()
    for _ in range(published):
        wire.send(keys.WORLD)
    wire.forge(keys.WORLD, ahead, 999)
    if goes_on:
        wire.send(keys.WORLD)

    wire.settle()

    assert wire.delivered[-1] == wire.expected[-1]
    wire.send(keys.WORLD)
    assert wire.delivered[-1] == wire.expected[-1]


def test_the_first_question_gets_two_seconds_of_events_and_the_last_state():
    sent = SentLog("run")
    write(sent, keys.WORLD, now=0.0)
    write(sent, keys.FEEDBACK, now=0.9)
    write(sent, keys.WORLD, now=0.95)
    write(sent, keys.FEEDBACK, now=1.0)
    write(sent, keys.BLOCK, now=2.0)

    past = answer(sent, Follower([keys.FEEDBACK, keys.WORLD], 3.0), 3.0)

    assert numbers(list(past.written)) == [3, 4]
    assert past.counts == {keys.WORLD: 2, keys.FEEDBACK: 2}


def test_what_is_recent_is_so_when_one_begins_to_follow_however_late_the_answer_comes():
    """A machine that stands still for seconds between question and answer takes nothing away."""
    sent, follower = SentLog("run"), Follower([keys.FEEDBACK], 10.0)
    for at in (7.9, 8.1, 10.0, 10.5):
        write(sent, keys.FEEDBACK, now=at)

    assert numbers([one for one, _ in follower.catch_up(answer(sent, follower, 14.0))]) == [2, 3, 4]


def test_after_a_cut_everything_kept_is_handed_out_however_old():
    sent, follower = SentLog("run"), Follower([keys.FEEDBACK, keys.BLOCK], 0.0)
    follower.catch_up(answer(sent, follower, 0.0))
    cut = [write(sent, key, now=0.0) for key in (keys.FEEDBACK, keys.BLOCK, keys.FEEDBACK)]

    follower.behind = True
    caught_up = follower.catch_up(answer(sent, follower, 100.0))

    assert caught_up == [(one, False) for one in cut]


def test_what_is_no_longer_kept_counts_as_lost():
    sent, follower = SentLog("run", kept=2), Follower([keys.FEEDBACK], 0.0)
    follower.catch_up(answer(sent, follower, 0.0))
    for _ in range(5):
        write(sent, keys.FEEDBACK)
    last = write(sent, keys.FEEDBACK)

    assert follower.take(last) == []
    assert numbers([one for one, _ in follower.catch_up(answer(sent, follower, 0.0))]) == [5, 6]
    assert follower.lost == 4


def test_a_state_that_was_overwritten_is_not_missed():
    sent, follower = SentLog("run"), Follower([keys.WORLD], 0.0)
    follower.catch_up(answer(sent, follower, 0.0))
    write(sent, keys.WORLD)
    second = write(sent, keys.WORLD)

    assert follower.take(second) == []
    assert follower.catch_up(answer(sent, follower, 0.0)) == [(second, False)]
    assert follower.lost == 0


def test_a_process_that_does_not_answer_holds_nothing_up():
    sent, follower = SentLog("run"), Follower([keys.FEEDBACK], 0.0)
    for _ in range(5):
        write(sent, keys.FEEDBACK)
    held = [write(sent, keys.FEEDBACK), write(sent, keys.FEEDBACK)]
    for one in reversed(held):
        assert follower.take(one) == []

    assert follower.catch_up(None) == [(one, False) for one in held]
    assert follower.lost == 0


def test_the_pulse_tells_of_the_keys_written_lately():
    sent = SentLog("run")
    write(sent, keys.FEEDBACK, now=0.0)
    write(sent, keys.BLOCK, now=2.0)

    assert sent.recent(2.5) == {"news": {keys.FEEDBACK: 1}, "commands": {keys.BLOCK: 1}}
    assert sent.recent(4.0) == {"commands": {keys.BLOCK: 1}}
    assert sent.recent(6.0) == {}


def test_what_was_told_before_a_reader_came_is_not_lost_and_what_is_gone_later_is() -> None:
    sent, follower = SentLog("run"), Follower(HEARD, 100.0)
    for now in range(5):
        write(sent, keys.FEEDBACK, float(now))  # long before the reader came
    assert follower.catch_up(answer(sent, follower, 100.0)) == []
    assert follower.lost == 0

    for now in (101.0, 102.0):
        write(sent, keys.FEEDBACK, now)
    follower.pulse(sent.recent(200.0))
    follower.behind = True
    gone = Past(dict(sent.counts), ())
    assert follower.catch_up(gone) == []
    assert follower.lost == 2


@given(st.lists(st.tuples(st.integers(0, 40), st.sampled_from(range(5, 400))), max_size=60), st.integers(1, 60))
def test_a_pulse_fits_into_its_row_and_has_the_keys_that_were_written_last(
    writes: list[tuple[int, int]], longest: int
):
    """The oracle: all counts of the last seconds, the newest first, as long as they fit."""
    sent = SentLog("run")
    key_of = {at: f"engage/v1/evt/{at}/{'k' * (40 * length)}" for at, (_, length) in enumerate(writes)}
    now = 0.0
    last: dict[str, float] = {}
    for at, (pause, _) in enumerate(writes):
        now += pause / 20
        key = key_of[at % longest]
        write(sent, key, now)
        last.pop(key, None)
        last[key] = now

    found = sent.recent(now).get("news", {})

    recent = [key for key, at in reversed(last.items()) if now - at <= PULSE_FOR]
    assert list(found) == recent[: len(found)]
    assert {key: sent.counts[key] for key in found} == found
    assert len(msgspec.msgpack.encode(("run", found))) <= SMALL
    assert len(found) == len(recent) or len(msgspec.msgpack.encode(found)) > SMALL - 20_000


def test_what_is_handed_out_of_a_key_fits_into_its_row_or_is_one_message():
    sizes = [100, 3000, 60_000, 10, 65_536, 65_536, 1, 30_000, 30_000, 30_000]
    key = keys.fault("there")
    written = [Written(key, "e" * 255, bytes(size), Envelope("s", "c", 0.0, n)) for n, size in enumerate(sizes)]

    parts = list(fitting(written, SMALL))

    assert [one for part in parts for one in part] == written
    for part in parts:
        packed = msgspec.msgpack.encode([(one.key, one.encoding, one.payload, one.envelope) for one in part])
        assert len(packed) <= SMALL + BESIDE
    assert len(parts) < len(sizes)


def test_a_pulse_of_many_keys_has_the_last_ones_and_stays_small() -> None:
    sent = SentLog("run")
    for number in range(10_000):
        write(sent, f"{keys.FEEDBACK}/{number:05}")

    (counts,) = sent.recent(0.0).values()

    assert [*counts] == [f"{keys.FEEDBACK}/{number:05}" for number in range(9999, 9999 - len(counts), -1)]
    assert 0.5 * SMALL < len(msgspec.msgpack.encode(counts)) < SMALL
