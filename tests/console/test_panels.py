"""The panels of the workshop: moved, put away, made wide, kept by the browser, and as at first again."""

import importlib.util
from itertools import chain

import pytest

from tests.console import browser
from tests.console.browser import Page
from tests.console.test_page import Place, opened
from tests.console.test_page import place as place

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `console` is not installed"),
    pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium on this machine"),
]
STANDS = """['wide', 'main', 'side'].map((name) => [...document.querySelector(`.column.${name}`).children]
  .filter((each) => each.checkVisibility()).map((each) => each.id))"""
FIRST = [
    [],
    ["scene", "above", "floor", "events", "behaviors", "net", "references", "notes"],
    ["part", "said", "wizard", "head", "measures", "health"],
]


async def press(page: Page, panel: str, name: str) -> None:
    """Press the button of a panel, as a keyboard does."""
    await page.value(f"document.querySelector('.desk [aria-label=\"{panel}: {name}\"]').click()")


async def again(page: Page, place: Place) -> None:
    await page.go(place.url)
    await page.until("window.engage?.state.you", 60)


async def test_panels_are_moved_put_away_made_wide_and_kept(place: Place) -> None:
    async with opened(place) as page:
        assert await page.value(STANDS) == FIRST
        await press(page, "Petri net", "over the whole width")
        await press(page, "From above", "earlier")
        await press(page, "Words", "later")
        await page.value("[...document.querySelectorAll('.desk input')].at(-1).click()")
        moved = [
            ["net"],
            ["above", "scene", "floor", "events", "behaviors", "references", "notes"],
            ["part", "wizard", "said", "head", "measures"],
        ]
        assert await page.value(STANDS) == moved
        assert (
            await page.value("document.querySelector('.desk [role=status]').textContent") == "Services is put away."
        )

        await again(page, place)
        assert await page.value(STANDS) == moved
        assert await page.value("document.querySelector('#net').getBoundingClientRect().width > innerWidth - 60")

        await press(page, "Petri net", "over the whole width")
        assert (await page.value(STANDS))[0] == []
        await page.value("document.querySelector('.desk > button').click()")
        assert await page.value(STANDS) == FIRST
        await again(page, place)
        assert await page.value(STANDS) == FIRST


@pytest.mark.parametrize("kept", ["{", "7", "[7]", '[[["nobody", true]], [["net", true]]]', '{"wide": []}'])
async def test_what_is_kept_and_makes_no_sense_loses_no_panel(place: Place, kept: str) -> None:
    async with opened(place) as page:
        await page.value(f"localStorage.setItem('engage-panels', {kept!r})")
        await again(page, place)
        assert sorted(chain(*await page.value(STANDS))) == sorted(chain(*FIRST))
        assert page.errors == []
        await page.value("localStorage.clear()")
