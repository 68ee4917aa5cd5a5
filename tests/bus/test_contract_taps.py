"""What a tap promises on every bus: all that a subscription gets, as it travels, and what nobody can read."""

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.messages import decode, published
from engage_hri.schemas.participants import PeerAlive
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.interface import Bus, Sample, Tap
from tests.bus.places import PATIENCE, Place, state

pytestmark = pytest.mark.each_bus


async def samples(bus: Bus, tap: Tap, number: int) -> list[Sample]:
    found = []
    while len(found) < number:
        one = await tap.next(bus.now() + PATIENCE)
        assert one is not None, f"{len(found)} of {number} have come"
        found.append(one)
    return found


async def test_a_tap_gets_payload_and_envelope_as_they_travel(place: Place):
    there, here = (await place.process()).join("there"), (await place.process()).join("here")
    tap = here.tap(keys.EVERYTHING)
    before = there.now()

    for number in range(3):
        there.publish(keys.fault("there"), state(number))

    found = await samples(here, tap, 3)
    assert [decode(each.payload, each.encoding) for each in found] == [state(number) for number in range(3)]
    sent = [published(keys.fault("there"), state(number)) for number in range(3)]
    assert [(each.payload, each.encoding) for each in found] == sent
    assert {(each.key, each.source, each.life) for each in found} == {(keys.fault("there"), "there", there.run)}
    numbers = [each.number for each in found]
    assert numbers == list(range(numbers[0], numbers[0] + 3))
    assert numbers[0] > 0
    assert all(before <= here.local(Stamp(each.clock, each.sent)) <= here.now() for each in found)


async def test_a_subscription_has_the_numbers_of_the_tap(place: Place):
    there, here = (await place.process()).join("there"), (await place.process()).join("here")
    tap, inbox = here.tap(keys.ANY_FAULT), here.subscribe(keys.ANY_FAULT)

    there.publish(keys.fault("there"), state(1))

    [sample] = await samples(here, tap, 1)
    received = await inbox.next(here.now() + PATIENCE)
    assert received is not None
    assert (received.life, received.number, received.source) == (sample.life, sample.number, sample.source)


async def test_a_tap_in_the_process_of_the_publisher_gets_the_same(place: Place):
    process = await place.process()
    there, here = process.join("there"), process.join("here")
    tap = here.tap(keys.ANY_FAULT)

    there.publish(keys.fault("there"), state(1))

    [sample] = await samples(here, tap, 1)
    assert (sample.payload, sample.encoding) == published(keys.fault("there"), state(1))
    assert (sample.source, sample.life) == ("there", there.run)
    assert sample.number > 0


async def test_a_late_tap_gets_the_last_states_and_who_is_there(place: Place):
    there = (await place.process()).join("there")
    there.declare_alive()
    there.publish(keys.WORLD, state(1))
    there.publish(keys.WORLD, state(2))
    here = (await place.process()).join("here")

    tap = here.tap(keys.EVERYTHING)

    token, last = await samples(here, tap, 2)
    assert decode(token.payload, token.encoding) == PeerAlive(participant="there", run=there.run)
    assert (token.key, token.source) == (keys.alive("there", "client"), "there")
    assert (decode(last.payload, last.encoding), last.past) == (state(2), True)


async def test_a_tap_gets_what_nobody_can_read(place: Place):
    here = (await place.process()).join("here")
    await place.process()  # which is where the other program stands
    tap = here.tap(keys.ANY_FEEDBACK)

    await place.inject(keys.FEEDBACK, b"no message", "application/json")

    [sample] = await samples(here, tap, 1)
    assert (sample.payload, sample.encoding, sample.source, sample.number) == (
        b"no message",
        "application/json",
        "",
        0,
    )


async def test_a_full_tap_drops_the_oldest_and_counts_it(place: Place):
    process = await place.process()
    there, here = process.join("there"), process.join("here")
    size = len(published(keys.fault("there"), state(0))[0]) + len(keys.fault("there"))
    tap = here.tap(keys.ANY_FAULT, capacity=3 * size)

    for number in range(5):
        there.publish(keys.fault("there"), state(number))

    found = await samples(here, tap, 3)
    assert [decode(each.payload, each.encoding) for each in found] == [state(2), state(3), state(4)]
    assert (tap.overflowed, tap.waiting, here.health.overflowed) == (2, 0, 2)


async def test_a_closed_tap_gets_nothing_more(place: Place):
    process = await place.process()
    there, here = process.join("there"), process.join("here")
    tap = here.tap(keys.ANY_FAULT)

    tap.close()
    there.publish(keys.fault("there"), state(1))

    assert await tap.next(here.now() + PATIENCE) is None
    assert tap.is_over
