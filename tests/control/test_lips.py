"""Lips of the simulated body: in step with the words, added to the mouth that an expression makes."""

import asyncio
import math
from collections.abc import Sequence
from itertools import pairwise

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import FaceShift, Mark, Speech
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.services.control.contract.body import MouthShape
from engage_hri.services.control.figure.alive import CHANGE, Mouth
from engage_hri.services.control.testing import WORLD, Stage, performed
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.control.voice.timeline import spelled, utter
from tests.control.test_alive import TEXT, sampled, shown


def summed(shapes: Sequence[MouthShape], t: float) -> tuple[float, float]:
    """Oracle: every change of shape, added up, by the polynomial of least jerk."""
    opening = width = 0.0
    for before, each in pairwise((MouthShape(-math.inf, 0.0), *shapes)):
        x = min(max((t - each.at) / CHANGE + 0.5, 0.0), 1.0)
        come = 10 * x**3 - 15 * x**4 + 6 * x**5
        opening, width = opening + come * (each.opening - before.opening), width + come * (each.width - before.width)
    return opening, width


def test_the_mouth_goes_from_shape_to_shape() -> None:
    mouth, shapes = Mouth(), [replace(each, at=each.at + 10.0) for each in spelled(utter(TEXT))]
    mouth.move(shapes, 9.0)

    for step in range(6000):
        t = 9.5 + step / 1000
        assert mouth.at(t) == pytest.approx(summed(shapes, t), abs=1e-9)
    assert mouth.at(100.0) == pytest.approx((0.0, 0.0))


def test_it_leaves_what_it_was_about_without_a_jump() -> None:
    mouth, shapes = Mouth(), [replace(each, at=each.at + 10.0) for each in spelled(utter(TEXT))]
    mouth.move(shapes, 9.0)
    before = mouth.at(10.3)
    mouth.move((), 10.3)

    assert before[0] > 0.1
    assert mouth.at(10.3) == pytest.approx(before)
    assert mouth.at(10.3 + CHANGE) == pytest.approx((0.0, 0.0))
    assert not mouth.is_moving(10.3 + CHANGE)


def test_the_mouth_opens_for_each_syllable_and_closes_after_the_words() -> None:
    shapes = spelled(utter("papa, tutu"))
    words = utter("papa, tutu").words

    wide = [each for each in shapes if each.opening > 0.2]
    assert [each.width < 0 for each in wide] == [False, False, True, True]  # rounded for u
    assert [each.at for each in shapes if each.opening == 0.0] == [word.end for word in words]
    assert spelled(utter("你好"))
    assert spelled(utter("👍")) == ()


async def openings(body: SimulatedBody, stage: Stage) -> list[tuple[float, float]]:
    """When the mouth is open how far, until the speech is over and a moment longer."""
    found = []
    while not stage.task.done():
        found.append((asyncio.get_running_loop().time(), body.idle().added.get("jaw", 0.0)))
        await asyncio.sleep(0.01)
    await stage.over()
    await asyncio.sleep(CHANGE)
    assert body.idle().added.get("jaw", 0.0) == pytest.approx(0.0)
    return found


async def test_lips_move_with_the_words_and_rest_in_pauses() -> None:
    body = SimulatedBody()
    body.see(WORLD)
    words = utter(TEXT).words
    begin = asyncio.get_running_loop().time()
    seen = await openings(body, Stage(body, Speech(id="s", text=TEXT), "end"))

    for word in words:
        assert max(opening for t, opening in seen if word.start <= t - begin <= word.end) > 0.15, word
    (pause,) = [(one.end, other.start) for one, other in pairwise(words) if other.start > one.end + 0.1]
    quiet = [opening for t, opening in seen if pause[0] + CHANGE < t - begin < pause[1] - CHANGE]
    assert quiet
    assert max(quiet) < 0.01


@pytest.mark.parametrize("how", ["at a mark", "held"])
async def test_lips_rest_while_the_voice_waits_and_go_on_with_it(how: str) -> None:
    body = SimulatedBody()
    body.see(WORLD)
    text, begin = "one two three four five six", asyncio.get_running_loop().time()
    mark = Mark("m", text.index("four"))
    stage = Stage(body, Speech(id="s", text=text, marks=(mark,)), "start" if how == "at a mark" else "end")
    at = utter(text).said_by(mark.position)
    if how == "held":
        await asyncio.sleep(at - 0.1)
        stage.authority.hold()
    await asyncio.sleep(begin + at + 0.1 - asyncio.get_running_loop().time())
    for _ in range(100):
        assert body.idle().added.get("jaw", 0.0) == pytest.approx(0.0, abs=1e-6)
        await asyncio.sleep(0.02)
    stage.authority.extend("end")
    stage.authority.go_on()
    resumed = asyncio.get_running_loop().time()
    seen = await openings(body, stage)

    for word in utter(text).words[3:]:
        since, until = (resumed + each - at for each in (word.start, word.end))
        assert max(opening for t, opening in seen if since <= t <= until) > 0.1, word


async def test_a_mute_voice_moves_its_lips_and_one_that_knows_it_does_not() -> None:
    """Thesis 5.4.3: "lips would just move without speech"."""
    body = SimulatedBody()
    body.switch_faults([BodyFault(kind="mute")])
    seen = await openings(body, Stage(body, Speech(id="s", text=TEXT), "end"))
    assert max(opening for _, opening in seen) > 0.3

    stage = Stage(body, Speech(id="t", text=TEXT), "end")
    body.switch_faults([])
    await asyncio.sleep(0.5)
    body.switch_faults([BodyFault(kind="voiceless")])
    await asyncio.gather(stage.task, return_exceptions=True)
    await asyncio.sleep(CHANGE)
    assert body.idle().added.get("jaw", 0.0) == pytest.approx(0.0)


async def test_lips_add_to_the_mouth_that_an_expression_makes() -> None:
    body = SimulatedBody()
    await performed(body, FaceShift(id="f", lexeme="OPEN_MOUTH", amount=1.0))
    assert shown(body, "jaw") == pytest.approx(rest := 0.95)
    stage = Stage(body, Speech(id="s", text=TEXT), "end")
    jaws = await sampled(body, "jaw", 2.0)
    assert rest - 1e-9 <= min(jaws) < max(jaws) <= 1.0  # there is hardly any way left
    await stage.over()

    await performed(body, FaceShift(id="g", lexeme="SMILE", amount=1.0))
    stage = Stage(body, Speech(id="t", text="you who"), "end")
    corners = await sampled(body, "left_mouth_corner", 0.8)
    assert 0.9 < min(corners) <= max(corners) <= 1.0  # nor for lips to be rounded, in a full smile
    await stage.over()


async def test_another_voice_moves_the_lips_and_this_one_others() -> None:
    body, heard = SimulatedBody(), list[Sequence[MouthShape]]()
    now = asyncio.get_running_loop().time()
    body.move_lips([MouthShape(now + 0.2, 1.0), MouthShape(now + 0.5, 0.0)])
    await asyncio.sleep(0.35)
    assert shown(body, "jaw") > 0.5

    body.on_lips = heard.append
    await performed(body, Speech(id="s", text="papa"))
    assert [bool(shapes) for shapes in heard] == [True]
