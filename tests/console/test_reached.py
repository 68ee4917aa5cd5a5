"""What the page lets people reach who have a narrow screen, a keyboard or a screen reader, in a real browser."""

import asyncio
import importlib.util

import pytest

from engage_hri.services.console.web.scene import seen
from tests.console.browser import Page
from tests.console.test_window import Place, needs_browser, opened, press, sit
from tests.console.test_window import place as place  # a fixture

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `console` is not installed"),
]
CONTRAST = """((text, ground) => {
  const light = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255)
    .map((part) => part <= 0.03928 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4)
    .reduce((sum, part, index) => sum + part * [0.2126, 0.7152, 0.0722][index], 0);
  const style = getComputedStyle(document.querySelector('.window'));
  const [a, b] = [text, ground].map((name) => light(style.getPropertyValue(name).trim())).sort((x, y) => y - x);
  return (a + 0.05) / (b + 0.05);
})('%s', '%s')"""
"""Contrast of two colours of the theme, as the guidelines for accessible pages (WCAG 2) define it."""
TEXTS = (
    *(("--onbar", bar) for bar in ("--gaze", "--mutual", "--pair", "--back", "--speech", "--point", "--bad")),
    *((text, "--paper") for text in ("--ink", "--quiet", "--bad", "--good", "--warn")),
    ("--quiet", "--stripe"), ("--ink", "--ground"),
)  # fmt: skip
"""Each colour of letters with each on which they are drawn."""


async def key(page: Page, name: str, code: int, text: str = "") -> None:
    """Press a key of the keyboard, wherever the focus is."""
    for kind in ("keyDown", "keyUp"):
        told = {"text": text} if text and kind == "keyDown" else {}
        await page.call("Input.dispatchKeyEvent", type=kind, key=name, windowsVirtualKeyCode=code, **told)


@needs_browser
async def test_bars_that_warn_stand_above_everything_on_a_narrow_screen(place: Place) -> None:
    async with opened(place) as page:
        await page.look(400, 900)
        await press(page, "Hold", "#wizard")
        await page.until("!document.querySelector('.switched').hidden")
        tops = "['.switched', '#scene'].map((each) => document.querySelector(each).getBoundingClientRect().top)"
        above, below = await page.value(tops)
        await press(page, "Go on", "#wizard")

        assert above < below


@needs_browser
async def test_keys_perform_the_script_also_after_a_click_on_a_button(place: Place) -> None:
    notes = "window.engage.state.notes.filter((each) => each.text.endsWith('%s')).length"
    said = notes % "performs fragment 1 of the script"
    async with opened(place) as page:
        before = await page.value(said)
        await page.value("document.querySelector('#wizard .faults button').focus()")
        await key(page, "1", 49, "1")
        await page.until(f"{said} === {before} + 1")
        await page.value("document.querySelector('#wizard-tell').focus()")
        await key(page, "1", 49, "1")

        await page.until("document.querySelector('#wizard-tell').value === '1'")
        assert await page.value(said) == before + 1


@needs_browser
async def test_faults_that_are_switched_quickly_are_all_switched(place: Place) -> None:
    click = "document.querySelector('#wizard [data-kind=\"%s\"]').click()"
    kinds = "window.engage.state.switched.kinds.join()"
    async with opened(place) as page:
        await page.until("document.querySelector('#wizard [data-kind=noise]')")
        await page.value(";".join(click % kind for kind in ("noise", "slow", "mute", "slow")))
        await page.until(f"{kinds} === 'noise,mute'")
        await page.value(";".join(click % kind for kind in ("mute", "noise")))

        await page.until(f"{kinds} === ''")


@needs_browser
async def test_two_windows_that_switch_faults_at_once_do_not_undo_one_another(place: Place) -> None:
    button = "document.querySelector('#wizard [data-kind=\"%s\"]')"
    kinds = "[...window.engage.state.switched.kinds].sort().join()"
    async with opened(place) as one, opened(place) as other:
        for page in (one, other):
            await page.until(button % "noise")
        await asyncio.gather(
            one.value(f"{button % 'noise'}.click()"), other.value(f"{button % 'mute'}.click()")
        )  # neither has seen what the other does
        for page in (one, other):
            await page.until(f"{kinds} === 'mute,noise'")

        await one.value(f"{button % 'mute'}.click()")
        await other.until(f"{kinds} === 'noise'")
        await other.value(f"{button % 'noise'}.click()")
        await one.until(f"{kinds} === ''")


@needs_browser
async def test_enter_takes_the_seat(place: Place) -> None:
    async with opened(place) as page:
        await page.value("document.querySelector('#your-name').value = 'eva'")
        await page.value("document.querySelector('#your-name').focus()")
        await key(page, "Enter", 13, "\r")

        await page.until("window.engage.state.you.person === 'eva'")


@needs_browser
async def test_everybody_at_the_table_is_in_view_from_above_and_reached_by_the_keyboard(place: Place) -> None:
    async with opened(place) as first, opened(place) as second:
        await sit(first, "ann")
        await sit(second, "ben")
        await first.until("document.querySelectorAll('#above .person').length === 2")
        outside = """(() => { const box = document.querySelector('.map').getBoundingClientRect();
          return [...document.querySelectorAll('#above .bodies > g')].filter((each) => {
            const own = each.getBoundingClientRect();
            return own.left < box.left || own.right > box.right || own.bottom > box.bottom || own.top < box.top;
          }).map((each) => each.dataset.id); })()"""
        await first.until(f"{outside}.length === 0")
        await first.value("document.querySelector('#above [data-id=ben]').focus()")
        await key(first, "Enter", 13, "\r")

        ann = "window.engage.state.scene.people.find((each) => each.id === 'ann')"
        await second.until(f"{ann}.looks?.[0] === 'ben'")
        assert await first.value("document.activeElement.dataset.id") == "ben"


@needs_browser
async def test_a_screen_reader_hears_what_was_said_once_and_each_news_once(place: Place) -> None:
    watch = """window.heard = [];
      new MutationObserver((changes) => changes.forEach(({ addedNodes }) =>
        addedNodes.forEach((node) => window.heard.push(node.textContent))))
        .observe(document.querySelector('.notes'), { childList: true })"""
    regions = "document.querySelectorAll('[aria-live=polite], [role=log], [role=status]')"
    live = f"[...{regions}].map((each) => each.className)"
    async with opened(place) as page:
        await sit(page, "uma")
        await page.until("document.querySelectorAll('.notes li').length")
        await page.value(watch)
        await page.value("document.querySelector('#wizard-tell').value = 'Three words here'")
        await press(page, "Say it", "#wizard")
        await page.until("document.querySelector('#said [role=log]').textContent.includes('robot: Three words here')")
        heard = await page.value("window.heard")

        assert sum("says 16 characters" in each for each in heard) == 1
        assert len(heard) == len(set(heard))
        assert set(await page.value(live)) == {
            "switched",
            "notes",
            "told",
            "unseen",
            "waits",
            "why",
        }  # nothing that runs on by itself


@needs_browser
async def test_a_turn_is_one_bubble_with_what_was_stopped_apart_and_each_word_is_read_once(place: Place) -> None:
    watch = """window.read = [];
      new MutationObserver((changes) => changes.forEach(({ addedNodes }) =>
        addedNodes.forEach((node) => window.read.push(node.textContent))))
        .observe(document.querySelector('#said [role=log]'), { childList: true })"""
    last = "document.querySelector('.words li:last-child')"
    async with opened(place) as page:
        await sit(page, "tia")
        await page.value(watch)
        await page.until(
            "[...document.querySelector('#wizard-target').options].some((each) => each.value === 'blue-square')"
        )
        words = (
            "Now look carefully at " + "this and " * 60 + "that"
        )  # half a minute, so that even a slow page holds it
        await page.value(f"document.querySelector('#wizard-tell').value = '{words}'")
        await page.value("document.querySelector('#wizard-target').value = 'blue-square'")
        await press(page, "Say it", "#wizard")
        await page.until(f"{last}.querySelector('.text').textContent.includes('Now look')")
        await page.value("window.engage.send({ do: 'steer', to: 'hold' })")
        await page.until(f"{last}.querySelector('.left.held')?.textContent.includes('held, still to come:')")
        await page.value("window.engage.send({ do: 'steer', to: 'continue' })")
        await page.until(f"!{last}.querySelector('.left')")
        await page.value("window.engage.send({ do: 'steer', to: 'stop' })")
        await page.until(f"{last}.querySelector('.left.stopped')?.textContent.includes('stopped, not said:')")
        await page.until("window.read.some((each) => each.includes('not said'))")

        shown = (await page.value(f"{last}.querySelector('.text').textContent")).split()
        read = (await page.value("window.read.join(' ')")).replace(".", "").split()
        assert read == ["robot:", *shown]
        mark = shown.index("stopped,")
        assert shown[mark : mark + 3] == ["stopped,", "not", "said:"]
        assert [*shown[:mark], *shown[mark + 3 :]] == [*words.split(), "the", "blue", "square"]
        assert await page.value("document.querySelectorAll('.words .left').length") == 1


@needs_browser
async def test_who_sits_down_by_the_keyboard_keeps_the_focus_and_buttons_answer(place: Place) -> None:
    focus = "document.activeElement.textContent"
    async with opened(place) as page:
        await page.until("document.querySelector('#part .there').textContent.includes('before the robot')")
        await page.value("document.querySelector('#your-name').value = 'yan'")
        await page.value("document.querySelector('#part button[type=submit]').focus()")
        await page.value("document.querySelector('#part button[type=submit]').click()")
        assert await page.value("document.querySelector('#part button[type=submit]').textContent") == "Sitting down…"
        await page.until(f"window.engage.state.you.person === 'yan' && {focus} === 'Look at the robot'")

        await press(page, "Stop", "#wizard")
        # What it stops depends on the moment: the robot turns to who has just sat down, or has already turned.
        await page.until("document.querySelector('#wizard .told').textContent.startsWith('stopped: ')")
        await press(page, "Leave", "#part")
        await page.until("document.querySelector('#part button[type=submit]').checkVisibility()")


@needs_browser
async def test_who_may_not_sit_down_is_told_and_may_try_again(place: Place) -> None:
    seat = "document.querySelector('#part button[type=submit]')"
    async with opened(place) as page:
        await page.value("document.querySelector('#your-name').value = 'blue-square'")
        await page.value(f"{seat}.click()")
        await page.until("document.querySelector('#part .told').textContent.includes('blue-square')")
        await page.until(f"{seat}.getAttribute('aria-disabled') === null")


@needs_browser
async def test_the_map_shows_things_where_the_pictures_of_a_recording_do(place: Place) -> None:
    drawn = "document.querySelector('.map .object[data-id=blue-square]').getAttribute('points')"
    corners = "window.engage.state.scene.things.find((each) => each.id === 'blue-square').outline"
    async with opened(place) as page:
        await page.until(f"{drawn}.length")
        points, outline = await page.value(f"[{drawn}, {corners}]")

        shown = [tuple(float(number) / 1000 for number in each.split(",")) for each in points.split()]
        assert shown == [pytest.approx(seen(x, y), abs=1e-3) for x, y in outline]


@needs_browser
async def test_pictures_say_who_looks_where(place: Place) -> None:
    async with opened(place) as page:
        await sit(page, "vera")
        for picture in (".map", ".space"):
            shown = f"document.querySelector('{picture}').getAttribute('aria-label')"
            await page.until(f"{shown}.includes('vera looks at robot.')")
        assert await page.value("document.querySelectorAll('h1').length") == 1


@needs_browser
async def test_all_letters_stand_out_from_what_they_are_drawn_on(place: Place) -> None:
    async with opened(place) as page:
        for dark in (False, True):
            await page.look(1280, 900, dark=dark)
            await page.until(f"document.body.classList.contains('body--dark') === {str(dark).lower()}")
            ratios = {pair: await page.value(CONTRAST % pair) for pair in TEXTS}

            assert {pair: ratio for pair, ratio in ratios.items() if ratio < 4.5} == {}


@needs_browser
async def test_kinds_and_people_are_told_apart_without_colours_and_signs_of_the_net_are_explained(
    place: Place,
) -> None:
    drawn = """window.drawn = new Set(); { const own = CanvasRenderingContext2D.prototype.fillText;
      CanvasRenderingContext2D.prototype.fillText = function (text, ...more) {
        if (this.canvas.closest('#measures')) window.drawn.add(text);
        return own.call(this, text, ...more);
      }; }"""
    async with opened(place) as page:
        await page.value(drawn)
        await sit(page, "wim")
        legend = "document.querySelectorAll('#measures .legend b')"
        marks = await page.value(f"[...{legend}].map((each) => each.textContent)")
        await page.until("window.drawn.has('wim')")
        await page.until(f"{marks}.some((each) => window.drawn.has(each))")

        assert len(set(marks)) == 4
        assert "[ stroke start" in await page.value("document.querySelector('#net .legend').textContent")
