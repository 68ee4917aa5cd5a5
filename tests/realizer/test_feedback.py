"""What the realizer says of a block: predictions while they are worth telling, and who it is about."""

from engage_hri.schemas.behaviors import Head, Pointing, Speech
from engage_hri.schemas.blocks import BlockProgress, PredictionFeedback, SyncPointProgress, WarningFeedback
from engage_hri.services.realizer.points import Point
from engage_hri.services.realizer.report import MOVED, moved_noticeably
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.stage import block, stage, together

POINT, STORY = Pointing(id="p", target="a"), Speech(id="s", text="one two")
BLOCK = block((POINT, STORY), together("p:stroke_start", "s:start"))
A, B = Point("a", "start"), Point("b", "end")


def test_a_prediction_moves_noticeably_if_any_point_does() -> None:
    old = {A: 1.0, B: 2.0}

    assert not moved_noticeably(old, {A: 1.0 + MOVED / 2, B: 2.0})
    assert moved_noticeably(old, {A: 1.0, B: 2.0 - 2 * MOVED})
    assert not moved_noticeably(old, {B: 2.0})
    assert moved_noticeably({A: 1.0}, {B: 2.0})


async def test_a_prediction_is_told_again_when_it_has_moved() -> None:
    slow = FakeBody({"p": Script(slow=2.0)})
    async with stage(slow) as seen:
        await seen.perform(BLOCK)

    first, *later = [
        {f"{each.behavior}:{each.sync}": each.time for each in said.points}
        for said in seen.feedback
        if isinstance(said, PredictionFeedback)
    ]
    assert first["s:start"] == 0.75
    assert later[0]["s:start"] == 1.5
    assert "p:ready" not in later[0]
    assert seen.times()["s:start"] == 1.5


async def test_a_body_on_time_is_predicted_once() -> None:
    async with stage() as seen:
        await seen.perform(BLOCK)

    assert sum(isinstance(said, PredictionFeedback) for said in seen.feedback) == 1


async def test_all_feedback_says_who_it_is_about_and_when() -> None:
    async with stage(FakeBody({"h": Script(fail="stroke")})) as seen:
        await seen.perform(block((Head(id="h", lexeme="NOD"), STORY), character_id="Melvin"))

    assert {type(said) for said in seen.feedback} == {
        BlockProgress, SyncPointProgress, PredictionFeedback, WarningFeedback
    }  # fmt: skip
    assert all(said.character_id == "Melvin" for said in seen.feedback)  # type: ignore[attr-defined]
    (warning,) = seen.warnings()
    assert warning.at is not None
    assert warning.at.seconds == 0.5
