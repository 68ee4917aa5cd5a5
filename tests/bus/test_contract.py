"""What every bus promises, tested on both: the memory bus on virtual time, Zenoh on real sockets."""

import asyncio
import threading

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.faults import NoReply
from engage_hri.schemas.fragments import Claim, HeadOwner
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.requests import Accepted
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.interface import Keep
from tests.bus.places import Place, echo, heard, messages, numbers, state, take
from tests.commanding import command

pytestmark = pytest.mark.each_bus


async def test_messages_of_one_publisher_keep_their_order_across_keys(place: Place):
    there, here = (await place.process()).join("there"), (await place.process()).join("here")
    ways = [keys.request_state("there"), keys.BLOCK, keys.WORLD, keys.fault("there"), keys.cancel("realizer")]
    inbox = here.subscribe(keys.ANY_REQUEST_STATE, keys.commands("realizer"), keys.WORLD, keys.ANY_FAULT)
    there.publish(keys.WORLD, state(-1))
    await take(inbox)  # of states published while somebody joins, only the last must reach him

    for number in range(300):
        there.publish(ways[number % len(ways)], state(number))

    assert numbers(await messages(inbox, 300)) == list(range(300))


async def test_a_message_comes_once_however_many_patterns_include_it(place: Place):
    there, here = (await place.process()).join("there"), (await place.process()).join("here")
    inbox = here.subscribe(keys.EVERYTHING, keys.ANY_FAULT, "engage/v1/evt/**", keys.fault("there"))

    for number in range(3):
        there.publish(keys.fault("there"), state(number))
    there.publish(keys.HEAD_OWNER, state(3))

    assert numbers(await messages(inbox, 4)) == [0, 1, 2, 3]


async def test_a_wildcard_takes_one_chunk_and_a_double_one_any_number(place: Place):
    there, here = (await place.process()).join("there"), (await place.process()).join("here")
    single, double = here.subscribe("engage/v1/evt/*/fault"), here.subscribe("engage/v1/state/**")

    there.publish(keys.fault("a"), state(0))
    there.publish(keys.statistics("all"), state(1))
    there.publish(keys.FEEDBACK, state(2))
    there.publish(keys.fault("b"), state(3))
    there.publish(keys.WORLD, state(4))

    assert numbers(await messages(single, 2)) == [0, 3]
    assert numbers(await messages(double, 2)) == [1, 4]


async def test_the_source_and_the_own_time_of_arrival_come_with_a_message(place: Place):
    there, here = (await place.process()).join("there"), (await place.process()).join("here")
    inbox = here.subscribe(keys.FEEDBACK)
    before = here.now()

    there.publish(keys.FEEDBACK, state(1))

    [received] = await take(inbox)
    assert (received.key, received.source) == (keys.FEEDBACK, "there")
    assert before <= received.at <= here.now()


@pytest.mark.parametrize("apart", [True, False])
async def test_a_late_subscriber_gets_the_last_state_once(place: Place, apart: bool):
    process = await place.process()
    there = process.join("there")
    here = (await place.process() if apart else process).join("here")
    for number in range(5):
        there.publish(keys.WORLD, state(number))

    inbox = here.subscribe(keys.WORLD)
    [last] = await take(inbox)
    there.publish(keys.WORLD, state(5))

    assert (numbers([last.message]), last.past) == ([4], True)
    assert numbers(await messages(inbox)) == [5]


async def test_of_a_state_that_several_publish_the_newest_value_is_the_last_word_for_whoever_comes_late(place: Place):
    speakers = [(await place.process()).join(f"speaker-{number}") for number in range(5)]
    reader = (await place.process()).join("reader")
    for turn in range(5):
        for number, speaker in enumerate(speakers[turn:] + speakers[:turn]):
            speaker.publish(keys.WORLD, state(10 * turn + number))
        with reader.subscribe(keys.WORLD, keys.ANY_FAULT) as inbox:
            for number, speaker in enumerate(speakers):  # what each hands out has come once this has
                speaker.publish(keys.fault(f"speaker-{number}"), state(100 + turn))
            seen: list[int] = []
            while seen.count(100 + turn) < len(speakers):
                seen += numbers(await messages(inbox))

        assert [number for number in seen if number < 100][-1] == 10 * turn + 4


@pytest.mark.parametrize("apart", [True, False])
async def test_a_state_that_was_withdrawn_comes_to_nobody_until_it_is_published_again(place: Place, apart: bool):
    process = await place.process()
    there = process.join("there")
    here = (await place.process() if apart else process).join("here")
    early = here.subscribe(keys.ANY_STATISTICS)
    for actor in ("ann", "bob", "all"):
        there.publish(keys.statistics(actor), state(1))
    assert len(await take(early, 3)) == 3

    there.withdraw(keys.statistics("ann"), keys.statistics("bob"), keys.statistics("nobody"))
    inbox = here.subscribe(keys.ANY_STATISTICS)
    [kept] = await take(inbox)
    there.publish(keys.statistics("bob"), state(2))

    assert (kept.key, kept.past) == (keys.statistics("all"), True)
    for reader in (early, inbox):
        [again] = await take(reader)
        assert (again.key, numbers([again.message])) == (keys.statistics("bob"), [2])
    assert here.health.lost == 0


@pytest.mark.parametrize("apart", [True, False])
async def test_a_late_subscriber_gets_commands_and_events_of_the_last_two_seconds_in_order(place: Place, apart: bool):
    process = await place.process()
    there = process.join("there")
    here = (await place.process() if apart else process).join("here")
    ways = [keys.BLOCK, keys.FEEDBACK, keys.cancel("realizer")]
    command(there, keys.BLOCK, state(1000))
    with there.subscribe(keys.INHIBIT) as never:
        assert await never.next(there.now() + keys.HISTORY_MAX_AGE + 0.1) is None
    for number in range(30):
        there.publish(ways[number % 3], state(number))

    inbox = here.subscribe(keys.commands("realizer"), keys.FEEDBACK)
    past = await take(inbox, 30)
    there.publish(keys.FEEDBACK, state(30))

    assert numbers([received.message for received in past]) == list(range(30))
    assert all(received.past for received in past)
    assert numbers(await messages(inbox)) == [30]


async def test_what_is_published_while_somebody_joins_comes_once_and_in_order(place: Place):
    there, hub = (await place.process()).join("there"), await place.process()
    ways = [keys.BLOCK, keys.FEEDBACK]
    inboxes = []

    for number in range(200):
        there.publish(ways[number % 2], state(number))
        if number % 20 == 10:
            inboxes.append(hub.join(f"here-{number}").subscribe(keys.BLOCK, keys.FEEDBACK))
            await asyncio.sleep(0)

    for inbox in inboxes:
        assert numbers(await messages(inbox, 200)) == list(range(200))


async def test_latest_keeps_only_the_newest_of_each_key(place: Place):
    there, here = (await place.process()).join("there"), (await place.process()).join("here")
    latest = here.subscribe(keys.FEEDBACK, keys.SYNC_POINT, keep=Keep.LATEST)
    every = here.subscribe(keys.FEEDBACK, keys.SYNC_POINT)

    for number in range(10):
        there.publish(keys.SYNC_POINT if number % 2 else keys.FEEDBACK, state(number))
    await take(every, 10)

    assert numbers(await messages(latest, 2)) == [8, 9]
    assert len(latest) == 0


async def test_a_full_queue_drops_the_oldest_and_counts(place: Place):
    there, here = (await place.process()).join("there"), (await place.process()).join("here")
    small, large = here.subscribe(keys.FEEDBACK, capacity=3), here.subscribe(keys.FEEDBACK)

    for number in range(10):
        there.publish(keys.FEEDBACK, state(number))
    await take(large, 10)

    assert numbers(await messages(small, 3)) == [7, 8, 9]
    assert (small.overflowed, large.overflowed) == (7, 0)
    assert (here.health.overflowed, there.health.overflowed) == (7, 0)
    small.close()
    assert here.health.overflowed == 7


async def test_one_can_ask_whether_anybody_listens(place: Place):
    there, here = (await place.process()).join("there"), (await place.process()).join("here")
    assert not there.is_heard(keys.ROBOT_MOTION)
    for bus in (here, there):  # in another process, and in this one
        inbox = bus.subscribe(keys.ANY_HEAD_POSE, "engage/v1/stream/control/*")
        async with asyncio.timeout(10.0):
            while not there.is_heard(keys.ROBOT_MOTION):  # noqa: ASYNC110 - nothing tells when
                await asyncio.sleep(0.01)
        assert not there.is_heard(keys.NET)
        inbox.close()
        async with asyncio.timeout(10.0):
            while there.is_heard(keys.ROBOT_MOTION):  # noqa: ASYNC110
                await asyncio.sleep(0.01)


async def test_a_stream_reaches_those_who_listen_and_nobody_later(place: Place):
    there, here = (await place.process()).join("there"), (await place.process()).join("here")
    inbox = here.subscribe(keys.ROBOT_MOTION, keep=Keep.LATEST)
    await heard(there, keys.ROBOT_MOTION, state(0), inbox)
    for number in range(20):
        there.publish(keys.ROBOT_MOTION, state(number))
    last = -1
    while last < 19:
        [last] = numbers(await messages(inbox))

    late = here.subscribe(keys.ROBOT_MOTION, keys.FEEDBACK)
    there.publish(keys.FEEDBACK, state(20))

    assert numbers(await messages(late)) == [20]


async def test_everybody_of_a_process_hears_a_message_once_its_publisher_too(place: Place):
    hub = await place.process()
    one, other = hub.join("one"), hub.join("other")
    inboxes = [one.subscribe(keys.FEEDBACK), other.subscribe(keys.FEEDBACK), other.subscribe("engage/v1/evt/**")]

    for number in range(3):
        one.publish(keys.FEEDBACK, state(number))

    for inbox in inboxes:
        assert numbers(await messages(inbox, 3)) == [0, 1, 2]
        assert len(inbox) == 0


async def test_a_name_is_taken_once(place: Place):
    hub = await place.process()
    hub.join("one")

    with pytest.raises(ValueError, match="one"):
        hub.join("one")


@pytest.mark.parametrize("apart", [True, False])
async def test_liveliness_tells_who_is_there_who_comes_and_who_goes(place: Place, apart: bool):
    process = await place.process()
    here, early = process.join("here"), process.join("early")
    late = (await place.process() if apart else process).join("late")
    early.declare_alive()

    inbox = here.subscribe(keys.ANY_ALIVE)
    first = await messages(inbox)
    late.declare_alive()
    late.declare_alive()
    second = await messages(inbox)
    await late.leave()
    await late.leave()
    third = await messages(inbox)

    assert here.health.peers == ("early",)
    assert [message.participant for message in first + second] == ["early", "late"]
    assert isinstance(first[0], PeerAlive)
    assert isinstance(second[0], PeerAlive)
    assert third == [PeerGone(participant="late")]


@pytest.mark.each_bus(shared=False)
async def test_another_life_of_a_name_has_another_run(place: Place):
    here = (await place.process()).join("here")
    inbox = here.subscribe(keys.ANY_ALIVE)
    lives = []
    for _ in range(2):
        hub = await place.process()
        bus = hub.join("service")
        bus.declare_alive()
        lives += await messages(inbox)
        await bus.leave()
        assert await messages(inbox) == [PeerGone(participant="service")]

    assert lives[0].run
    assert lives[0].run != lives[1].run


async def test_two_robots_do_not_hear_each_other(place: Place):
    mine, other = (await place.process("left")).join("me"), (await place.process("right")).join("me")
    inbox = mine.subscribe(keys.EVERYTHING)
    other_inbox = other.subscribe(keys.EVERYTHING)
    other.answer(keys.DESCRIBE, echo)
    other.declare_alive()

    other.publish(keys.FEEDBACK, state(1))
    await take(other_inbox, 2)

    with pytest.raises(NoReply):
        await mine.query(keys.DESCRIBE, Accepted(id="a"), timeout=0.3)
    assert len(inbox) == 0


async def test_stamps_of_another_process_read_as_local_time(place: Place):
    there, here = (await place.process()).join("there"), (await place.process()).join("here")
    inbox = here.subscribe(keys.HEAD_OWNER)

    there.publish(keys.HEAD_OWNER, HeadOwner(owner=Claim(kind="none", priority=0), since=there.stamp()))

    [received] = await take(inbox)
    assert here.local(received.message.since) == received.message.since.seconds
    assert here.local(Stamp(here.clock, 5.0)) == 5.0


async def test_a_closed_subscription_ends_its_reader_and_others_go_on(place: Place):
    there, here = (await place.process()).join("there"), (await place.process()).join("here")
    closing, staying = here.subscribe(keys.FEEDBACK), here.subscribe(keys.FEEDBACK)
    reading = asyncio.create_task(closing.next(), name="reading")
    await asyncio.sleep(0)

    closing.close()
    there.publish(keys.FEEDBACK, state(1))

    assert await reading is None
    assert numbers(await messages(staying)) == [1]
    assert len(closing) == 0


async def test_leaving_ends_readers_and_publishes_no_more(place: Place):
    there, here = (await place.process()).join("there"), (await place.process()).join("here")
    inbox = there.subscribe(keys.FEEDBACK)
    other = here.subscribe(keys.FEEDBACK)

    await there.leave()
    there.publish(keys.FEEDBACK, state(1))
    here.publish(keys.FEEDBACK, state(2))

    assert await inbox.next() is None
    assert numbers(await messages(other)) == [2]


async def test_closing_leaves_no_task_and_no_thread(place: Place):
    before = {*threading.enumerate()}  # callbacks of Zenoh, in other tests, leave threads on this list
    hub, other = await place.process(), await place.process()
    bus = hub.join("one")
    bus.declare_alive()
    bus.answer(keys.DESCRIBE, echo)
    inbox = bus.subscribe(keys.EVERYTHING)
    there = other.join("there")
    there.publish(keys.FEEDBACK, state(1))
    await there.query(keys.DESCRIBE, Accepted(id="a"))
    bus.publish(keys.FEEDBACK, state(2))

    await hub.close()
    await hub.close()

    assert asyncio.all_tasks() == {asyncio.current_task()}
    assert {*threading.enumerate()} <= before
    while await inbox.next() is not None:
        pass


async def test_a_subscription_of_who_has_left_is_over_at_once(place: Place):
    hub = await place.process()
    here = hub.join("here")
    await here.leave()

    for inbox in (here.subscribe(keys.ANY_FAULT), here.tap(keys.ANY_FAULT)):
        assert await inbox.next() is None
        assert inbox.is_over
