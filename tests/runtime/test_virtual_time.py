import asyncio
import math

import pytest

from engage_hri.services.runtime.virtual_time import Deadlock, TimeRanOut, VirtualTimeLoop, run_virtual


async def test_time_is_exact_and_starts_at_zero():
    loop = asyncio.get_running_loop()

    await asyncio.sleep(0.1)
    await asyncio.sleep(0.2)

    assert loop.time() == 0.1 + 0.2


async def test_timers_fire_at_their_exact_instant_in_order_and_together_when_due_together():
    loop = asyncio.get_running_loop()
    fired: list[tuple[str, float]] = []
    for name, at in (("c", 3.3), ("a", 1.1), ("b", 3.3), ("never", 2.0)):
        timer = loop.call_at(at, lambda name=name: fired.append((name, loop.time())))
        if name == "never":
            timer.cancel()

    await asyncio.sleep(5.0)

    assert fired == [("a", 1.1), ("c", 3.3), ("b", 3.3)]


async def test_time_stands_still_while_there_is_something_to_do():
    loop = asyncio.get_running_loop()
    loop.call_later(0.001, lambda: None)

    for _ in range(1000):
        await asyncio.sleep(0)

    assert loop.time() == 0.0


async def test_a_timeout_needs_no_patience():
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(3600.0):
            await asyncio.Event().wait()

    assert asyncio.get_running_loop().time() == 3600.0


def test_a_century_does_not_stop_the_clock():
    async def main() -> float:
        await asyncio.sleep(3e9)
        for _ in range(10):
            await asyncio.sleep(0.001)
        return asyncio.get_running_loop().time()

    assert run_virtual(main()) == pytest.approx(3e9 + 0.01, abs=1e-5)


def test_a_wake_up_from_another_thread_counts_as_something_to_do():
    async def main() -> None:
        asyncio.get_running_loop().call_soon_threadsafe((done := asyncio.Event()).set)
        await asyncio.sleep(1.0)
        assert done.is_set()

    run_virtual(main())


def test_waiting_for_nothing_is_a_named_failure():
    async def main() -> None:
        async with asyncio.TaskGroup() as group:
            group.create_task(asyncio.Event().wait(), name="the gardener")
            group.create_task(asyncio.Event().wait(), name="the fool")

    with pytest.raises(Deadlock, match=r"the fool \(.*\.py:\d+\), the gardener \("):
        run_virtual(main())


def test_a_deadlock_still_lets_every_task_clean_up():
    cleaned = []

    async def main() -> None:
        try:
            await asyncio.Event().wait()
        finally:
            cleaned.append("up")

    with pytest.raises(Deadlock):
        run_virtual(main())

    assert cleaned == ["up"]


def test_waiting_for_nothing_while_a_timer_repeats_ends_at_the_limit():
    async def main() -> None:
        loop = asyncio.get_running_loop()

        def tick() -> None:
            loop.call_later(2.0, tick)

        tick()
        await asyncio.Event().wait()

    with (
        pytest.raises(TimeRanOut, match="1002 s"),
        asyncio.Runner(loop_factory=lambda: VirtualTimeLoop(limit=1000.0)) as runner,
    ):
        runner.run(main())


def test_there_is_no_limit_by_default():
    assert run_virtual(asyncio.sleep(1e6, "done")) == "done"


def test_no_timer_fires_before_its_time_however_little_is_missing() -> None:
    async def fires() -> list[tuple[float, float]]:
        loop = asyncio.get_running_loop()
        fired: list[tuple[float, float]] = []
        await asyncio.sleep(103.7)
        for when in (loop.time(), math.nextafter(loop.time(), math.inf), loop.time() + 4e-14, loop.time() + 1e-10):
            loop.call_at(when, lambda when=when: fired.append((when, loop.time())))
        await asyncio.sleep(1.0)
        return fired

    assert [when <= at for when, at in run_virtual(fires())] == [True] * 4
