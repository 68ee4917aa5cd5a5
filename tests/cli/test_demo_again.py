"""When a demo for visitors begins anew: played without a robot, in virtual time."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, nullcontext
from types import SimpleNamespace
from typing import Any

import pytest

from engage_hri.services.commandline.look.demo import EMPTY, _shown


class Visits:
    """The window of a demo, and when it was played from the beginning, in seconds."""

    def __init__(self) -> None:
        self.began: list[float] = []
        self.over: list[asyncio.Event] = []
        self.picture = SimpleNamespace(present=())
        self.bus = SimpleNamespace(now=asyncio.get_running_loop().time)

    @asynccontextmanager
    async def play(self) -> AsyncIterator[asyncio.Event]:
        self.began.append(self.bus.now())
        self.over.append(asyncio.Event())
        yield self.over[-1]

    def shown(self, **how: bool) -> "asyncio.Task[None]":
        window: Any = self
        return asyncio.create_task(_shown(self.play, nullcontext(), window, **how))


@pytest.mark.parametrize(("kiosk", "anew"), [(False, 40.0), (True, 20.0)])
async def test_after_the_goodbye_it_begins_anew_for_whoever_comes_next(kiosk: bool, anew: float) -> None:
    visits = Visits()
    shown = visits.shown(again=True, kiosk=kiosk)
    await asyncio.sleep(5.0)
    visits.picture.present = ("ann",)
    await asyncio.sleep(15.0)
    visits.over[0].set()
    await asyncio.sleep(15.0)
    visits.picture.present = ()
    await asyncio.sleep(10.0)
    shown.cancel()
    await asyncio.wait([shown])

    assert visits.began[0] == 0.0
    assert visits.began[1] == pytest.approx(anew, abs=1.0)


async def test_a_kiosk_begins_anew_when_its_visitor_has_left_and_not_before_one_has_come() -> None:
    visits = Visits()
    shown = visits.shown(again=True, kiosk=True)
    await asyncio.sleep(100.0)
    visits.picture.present = ("ann",)
    await asyncio.sleep(10.0)
    visits.picture.present = ()
    await asyncio.sleep(EMPTY + 1.0)
    shown.cancel()
    await asyncio.wait([shown])

    assert visits.began == [0.0, pytest.approx(110.0 + EMPTY, abs=1.0)]


async def test_a_machine_that_stands_still_does_not_let_a_kiosks_visitor_go() -> None:
    visits, stood = Visits(), 0.0
    now = visits.bus.now
    visits.bus.now = lambda: now() + stood
    shown = visits.shown(again=True, kiosk=True)
    visits.picture.present = ("ann",)
    await asyncio.sleep(10.0)
    stood = EMPTY + 1.0
    await asyncio.sleep(10.0)
    shown.cancel()
    await asyncio.wait([shown])

    assert visits.began == [0.0]


async def test_one_that_is_recorded_ends_with_the_goodbye() -> None:
    visits = Visits()
    shown = visits.shown(again=False, kiosk=False)
    await asyncio.sleep(10.0)
    visits.over[0].set()
    await shown

    assert visits.began == [0.0]
