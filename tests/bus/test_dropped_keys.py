"""Keys that come and go, as people do: each message once and in order, losses counted, and no growth."""

from collections import deque
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas import keys
from engage_hri.services.bus.zenoh.order import Follower, Missing, Past, SentLog, Written
from tests.bus.test_order import answer, write
from tests.random_cases import share_of

KEPT = 6
LONG = 1000
"""Number of messages and answers after which nothing settles any more."""
PEOPLE = 5
EVENTS = tuple(keys.connection_event(f"p{number}", "backchannel") for number in range(PEOPLE))
STATES = tuple(keys.statistics(f"p{number}") for number in range(PEOPLE))
HEARD = (keys.ANY_CONNECTION_EVENT, keys.ANY_STATISTICS)


class Line:
    """A process that keeps little, one that has followed it from its start, and a link between them that is cut.

    A question takes a while to come to the process. Its answer takes the same link as the messages, and so comes
    before what is published after it.
    """

    def __init__(self) -> None:
        self.sent, self.follower = SentLog("run", KEPT), Follower(HEARD, 0.0)
        self.delivered: list[Written] = []
        self.published: list[Written] = []
        self.on_the_way: deque[Written | Past] = deque()
        self.question: Missing | None = None
        self.is_asking = self.is_cut = False
        self.settle()

    def publish(self, key: str) -> None:
        written = write(self.sent, key)
        self.published.append(written)
        if not self.is_cut:
            self.on_the_way.append(written)

    def withdraw(self, key: str) -> None:
        self.sent.withdraw(key)

    def cut(self) -> None:
        self.is_cut, self.is_asking, self.question = True, False, None
        self.on_the_way.clear()

    def heal(self) -> None:
        self.follower.behind |= self.is_cut
        self.is_cut = False
        self.ask()

    def ask(self) -> None:
        if self.follower.behind and not self.is_asking and not self.is_cut:
            self.is_asking, self.question = True, self.follower.missing(0.0)

    def reply(self) -> None:
        if self.question is not None:
            self.on_the_way.append(self.sent.past(lambda key: True, self.question, -keys.HISTORY_MAX_AGE))
            self.question = None

    def arrive(self) -> None:
        if not self.on_the_way:
            return
        came = self.on_the_way.popleft()
        if isinstance(came, Past):
            self.is_asking = False
            self.delivered += [one for one, _ in self.follower.catch_up(came)]
        else:
            self.delivered += self.follower.take(came)
        self.ask()

    def settle(self) -> None:
        self.heal()
        for _ in range(LONG):
            if not self.on_the_way and self.question is None:
                return
            self.arrive()
            self.reply()
        raise AssertionError("it asks for ever")


STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("publish"), st.sampled_from((*EVENTS, *STATES))),
        st.tuples(st.just("withdraw"), st.sampled_from(STATES)),
        st.tuples(st.sampled_from(["cut", "heal", "arrive", "reply", "settle"])),
    ),
    max_size=100,
)


@given(STEPS)
@settings(max_examples=share_of(300), deadline=None)
def test_whatever_keys_come_and_go_each_message_comes_once_in_order_and_what_is_lost_is_counted(
    steps: list[Any],
) -> None:
    line = Line()

    for what, *how in steps:
        getattr(line, what)(*how)
    line.settle()

    numbers = [one.envelope.number for one in line.delivered]
    assert len(set(numbers)) == len(numbers)
    for key in (*EVENTS, *STATES):
        of_key = [one.envelope.number for one in line.delivered if one.key == key]
        assert of_key == sorted(of_key)
    events = [one for one in line.published if one.key in EVENTS]
    came = [one for one in line.delivered if one.key in EVENTS]
    assert set(came) >= set(events[-KEPT:])
    assert line.follower.lost <= len(events) - len(came)
    assert line.follower.forged == 0
    for key in STATES:
        last = [one for one in line.published if one.key == key][-1:]
        is_kept = key in line.sent.counts
        assert not is_kept or [one for one in line.delivered if one.key == key][-1:] == last


@given(STEPS)
@settings(max_examples=100, deadline=None)
def test_what_is_lost_in_a_cut_is_counted_in_full_as_long_as_its_key_is_kept(steps: list[Any]) -> None:
    """With one key that is written again and again nothing of it is dropped, so nothing is left uncounted."""
    line = Line()

    for what, *how in steps:
        if what == "publish":
            line.publish(EVENTS[0])
        elif what != "withdraw":
            getattr(line, what)(*how)
    line.settle()

    assert line.follower.lost == len(line.published) - len(line.delivered)


def test_a_day_of_people_leaves_no_more_than_an_hour_of_them() -> None:
    line = Line()
    sizes = []

    for number in range(500):
        event, state = keys.connection_event(f"visitor-{number}", "backchannel"), keys.statistics(f"visitor-{number}")
        line.publish(event)
        line.publish(state)
        line.settle()
        line.withdraw(state)
        sizes.append((len(line.sent.counts), len(line.follower.missing(0.0).seen)))

    assert max(sent for sent, _ in sizes) <= KEPT + 1
    assert max(seen for _, seen in sizes) <= KEPT + 2
    assert line.follower.lost == line.follower.forged == 0
    assert line.delivered == line.published


def test_a_person_who_comes_back_after_the_key_was_dropped_is_heard_at_once() -> None:
    line = Line()
    for key in (EVENTS[0], *[EVENTS[1]] * KEPT, EVENTS[0]):
        line.publish(key)
        line.settle()

    assert line.delivered == line.published
    assert line.published[-1].envelope.base == 1


def test_what_was_withdrawn_is_not_given_to_who_comes_later() -> None:
    line = Line()
    line.publish(STATES[0])
    line.publish(STATES[1])
    line.withdraw(STATES[0])
    line.withdraw(STATES[2])

    past = answer(line.sent, Follower(HEARD, 0.0))

    assert [one.key for one in past.written] == [STATES[1]]
    assert past.counts == {STATES[1]: 1}
