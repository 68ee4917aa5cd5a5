"""A condition of a study that begins while the robot runs: obeyed at once, told to all, gone with a life."""

import asyncio

import pytest

from engage_hri.schemas.behaviors import Gaze, Speech
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.fragments import FragmentOutcome, StudyCondition, TurnFragment
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.feeds import Feed
from engage_hri.services.client.robot import Robot
from engage_hri.services.generation.config import GenerationConfig
from tests.generation.partners import gaze_targets, stage

LOOK = Gaze(id="look", target="middle")
SAY = Speech(id="s", text="Look")


def fragment(id: str) -> TurnFragment:
    return TurnFragment(id=id, turn_status="full", behaviors=(LOOK, SAY))


async def told(feed: Feed[StudyCondition]) -> tuple[str, bool, str]:
    next = await feed.next(1.0)
    assert next is not None
    return next.name, next.speech_only, next.by


async def test_speech_only_holds_for_what_comes_and_ends_with_the_next_condition(hub: MemoryHub) -> None:
    async with stage(hub) as partners, Robot.on(hub.join("anna", "wizard")) as anna:
        outcomes, looked = [], []
        for name, speech_only in (("a", False), ("b", True), ("c", False)):
            await anna.set_condition(name, speech_only=speech_only)
            pending = partners.send(fragment(name))
            looked.append("middle" in gaze_targets(await partners.fragment_block(name)))
            partners.end(partners.request(name))
            outcomes.append(await pending.outcome)

        assert looked == [True, False, True]
        assert [isinstance(each, FragmentOutcome) and each.warnings for each in outcomes] == [
            (), ("look is left out: inhibited",), (),
        ]  # fmt: skip


async def test_a_look_under_way_is_broken_off_and_the_head_goes_up(hub: MemoryHub) -> None:
    async with stage(hub) as partners, Robot.on(hub.join("anna", "wizard")) as anna:
        partners.send(fragment("f"))
        await partners.fragment_block("f")
        partners.reach("f", "look", "start")
        await asyncio.sleep(1.0)
        await anna.set_condition("words", speech_only=True)
        await asyncio.sleep(0.1)

        assert [(abort.block, abort.behavior) for abort in partners.aborts] == [("f", "look")]
        await asyncio.sleep(5.0)
        assert partners.owners[-1].owner.reason == "speech only: head up right"

        await anna.set_condition("all")
        await asyncio.sleep(5.0)
        assert partners.owners[-1].owner.kind != "inhibition"


async def test_who_comes_late_is_told_which_is_in_force_and_who_set_it(hub: MemoryHub) -> None:
    async with stage(hub), Robot.on(hub.join("anna", "wizard")) as anna:
        with anna.conditions() as conditions:
            assert await told(conditions) == ("", False, "")  # nobody has set one
        await anna.set_condition("a", by="Anna")
        await anna.set_condition("b", speech_only=True)
        await asyncio.sleep(60.0)
        async with Robot.on(hub.join("late", "observer")) as late:
            with late.conditions() as conditions:
                assert await told(conditions) == ("b", True, "anna")
                await anna.set_condition()
                assert await told(conditions) == ("", False, "anna")


async def test_another_life_has_what_its_configuration_says(hub: MemoryHub) -> None:
    speechless = GenerationConfig(condition="degraded-generation")
    async with stage(hub, speechless), Robot.on(hub.join("anna", "wizard")) as anna:
        with anna.conditions() as conditions:
            assert await told(conditions) == ("", True, "")
            await anna.set_condition("a", by="Anna")
            assert await told(conditions) == ("a", False, "Anna")
    async with MemoryHub("robot") as other, stage(other, speechless), Robot.on(other.join("bert")) as bert:
        with bert.conditions() as conditions:
            assert await told(conditions) == ("", True, "")


async def test_a_name_that_is_too_long_is_refused_and_changes_nothing(hub: MemoryHub) -> None:
    async with stage(hub), Robot.on(hub.join("anna", "wizard")) as anna:
        await anna.set_condition("a")
        with pytest.raises(InputRefused, match="80"):
            await anna.set_condition("x" * 81, speech_only=True)
        with anna.conditions() as conditions:
            assert await told(conditions) == ("a", False, "anna")
