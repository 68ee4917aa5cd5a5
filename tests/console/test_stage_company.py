"""The stage in real browsers for several visitors: what each of them sees of the others."""

import asyncio
import importlib.util
from contextlib import AsyncExitStack
from pathlib import Path

import pytest

from engage_hri import connect, perceive
from engage_hri.services.bus.zenoh.hub import open_hub
from tests.console.browser import waited
from tests.console.test_stage import (
    HIDDEN,
    PHONE,
    SCROLLS,
    SEAT,
    STAGE,
    Place,
    needs_browser,
    opened,
    press,
    sit,
)
from tests.console.test_stage import place as place
from tests.console.windows import engage

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `console` is not installed"),
]


@needs_browser
async def test_two_visitors_see_the_table_each_from_their_own_place_and_are_called_as_the_page_calls_somebody(
    place: Place,
) -> None:
    words = "['.sit', '.what'].map((each) => document.querySelector(each).textContent)"
    names = "[...document.querySelectorAll('.heads .name b')].map((each) => each.textContent)"
    async with opened(place) as one:
        await sit(one)
        async with opened(place, language="de-AT") as other:
            await other.until(f"{SEAT}.textContent === 'Auch hinsetzen'")
            assert (await other.value(words))[1].startswith("Jemand ist schon hier. ")
            await other.until(f"{names}.join() === 'Gast'")
            await press(other, ".other")
            await other.until(f"{names}.join() === 'Visitor'")
            assert (await other.value(words))[0] == "Sit down, too"
            assert (await other.value(words))[1].startswith("Somebody is here already. ")
            await sit(other)
            for width, height in (PHONE, (1366, 768)):
                await other.look(width, height, calm=True)
                isStill = f"window.stage.box.width === {width} && window.stage.shown.isStill"
                await other.until(f"{isStill} && !({HIDDEN}).length")
        named = """import('./stage/words.js').then(({ texts }) => ["en", "de"].map((name) => texts(name, "en"))
          .map(({ beside, others, listed }) => [["ann"], ["ann", "ben"], ["ann", "visitor"]]
            .map((ids) => [beside(listed(ids)), others(listed(ids), ids.length)])))"""
        assert await one.value(named) == [
            [
                ["Sit down beside ann", "ann is here already."],
                ["Sit down beside ann and ben", "ann and ben are here already."],
                ["Sit down, too", "Others are here already."],
            ],
            [
                ["Neben ann setzen", "ann ist schon hier."],
                ["Neben ann und ben setzen", "ann und ben sind schon hier."],
                ["Auch hinsetzen", "Andere sind schon hier."],
            ],
        ]


@needs_browser
async def test_a_third_visitor_reads_each_name_and_to_whom_the_robot_speaks(place: Place) -> None:
    rects = """[...document.querySelectorAll('.heads .name')].map((each) => each.getBoundingClientRect())
      .map(({ left, top, right, bottom }) => [left, top, right, bottom])"""
    hint = "document.querySelector('.hint').textContent"
    async with await open_hub("robot", connect=(place.endpoint,)) as hub, AsyncExitStack() as company:
        for name in ("ann", "ben"):
            await company.enter_async_context(perceive(name, hub=hub))
        async with opened(place) as page, connect(hub=hub, name="manager") as robot:
            await sit(page)
            for width, height in (PHONE, (844, 390), (1366, 768)):
                await page.look(width, height)
                await page.until(f"window.stage.box.width === {width} && window.stage.shown.isStill")
                await page.until("document.querySelectorAll('.heads .name').length === 2")
                one, other = await page.value(rects)
                assert one[0] >= other[2] or other[0] >= one[2] or one[1] >= other[3] or other[1] >= one[3]
            turn = {"turn_status": "full", "parts": [{"say": "Do you know what this is, and where it comes from?"}]}
            saying = asyncio.create_task(robot.perform(turn, addressee="ben"))
            await page.until(f"{hint} === 'The robot is speaking to ben.'", 20)
            await saying


@needs_browser
async def test_what_one_can_say_is_said_at_a_touch(tmp_path: Path, place: Place) -> None:
    said = "[...document.querySelectorAll('.bubble.you span')].map((each) => each.textContent).join('')"
    sizes = "[...document.querySelectorAll('.saying')].map((each) => each.getBoundingClientRect().height)"
    phrases = '["where is the cup", "thank you"]'
    console = ("console", "--connect", place.endpoint, "--port", "0", "--role", "wizard")
    with engage(tmp_path / "console", *console, "--set", f"hearing.phrases={phrases}") as window:
        url = waited(window, tmp_path / "console", STAGE)
        async with opened(place._replace(stage=url)) as page:
            await sit(page)
            assert all(height >= 44 for height in await page.value(sizes))
            await press(page, ".saying")
            await page.until(f"{said}.includes('where is the cup')")
            assert await page.value(SCROLLS) == 0
    async with opened(place) as page:  # nobody knows what one can say
        assert await page.value("document.querySelector('.sayings').hidden")
