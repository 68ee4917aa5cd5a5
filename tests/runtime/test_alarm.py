"""Timers that are set again, also on a loop whose handles know no time: uvloop's, once it has come."""

import asyncio
from typing import Any

from engage_hri.services.runtime.loop import Alarm, Timer
from engage_hri.services.runtime.virtual_time import VirtualTimeLoop


class WholeMilliseconds(VirtualTimeLoop):
    """As uvloop: an instant is rounded to milliseconds, and what is 0 ms ahead is a plain handle."""

    def call_at(self, when: float, callback: Any, *args: Any, context: Any = None) -> Any:
        if round((when - self.time()) * 1000) <= 0:
            return self.call_soon(callback, *args, context=context)
        return super().call_at(when, callback, *args, context=context)


def rung(*instants: float | None) -> list[float]:
    """When a timer rings that is set to each of these in turn, before any of them."""

    async def main() -> list[float]:
        loop, rings = asyncio.get_running_loop(), list[float]()
        timer = Timer(lambda: rings.append(round(loop.time(), 6)))
        for at in instants:
            timer.set(at)
        await asyncio.sleep(10.0)
        return rings

    with asyncio.Runner(loop_factory=WholeMilliseconds) as runner:
        return runner.run(main())


def test_a_timer_rings_once_at_the_instant_it_was_set_to_last() -> None:
    assert rung(3.0, 1.0, 2.0) == [2.0]
    assert rung(2.0, 2.0) == [2.0]
    assert rung(2.0, None) == []


def test_it_can_be_set_again_as_its_instant_comes() -> None:
    assert rung(0.0002, 0.0003, 1.0) == [1.0]
    assert rung(0.0002, 0.0002) == [0.0]


def test_an_alarm_rings_no_later_than_the_earliest_instant_it_was_given() -> None:
    async def main() -> list[float]:
        loop, rings = asyncio.get_running_loop(), list[float]()
        alarm = Alarm(lambda: rings.append(loop.time()))
        for at in (3.0, 1.0, 2.0, None):
            alarm.set(at)
        await asyncio.sleep(1.5)
        alarm.set(4.0)  # it can be set again once it has rung
        await asyncio.sleep(3.5)
        alarm.set(6.0)
        alarm.stop()
        alarm.set(7.0)  # and once it was stopped
        await asyncio.sleep(10.0)
        return rings

    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        assert runner.run(main()) == [1.0, 4.0, 7.0]


def test_a_timer_tells_when_it_is_to_ring() -> None:
    async def main() -> list[float | None]:
        timer = Timer(lambda: None)
        told = [timer.at]
        for at in (3.0, 2.0, None, 1.0):
            timer.set(at)
            told.append(timer.at)
        await asyncio.sleep(5.0)
        return [*told, timer.at]

    with asyncio.Runner(loop_factory=WholeMilliseconds) as runner:
        assert runner.run(main()) == [None, 3.0, 2.0, None, 1.0, None]
