"""References whose gestures this body gives up, by its motors and by its reach: they are chosen again."""

import asyncio

import pytest

pytest.importorskip("mujoco", reason="needs the extra `mujoco`")

from engage_hri import perceive
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.summary import Summary
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.language_models import perform_call
from tests.generation.test_chosen_again import CALL, cup, robot

PHYSICAL = ("control.body=mujoco", "control.voice=silent")
WITHIN_REACH = (0.5, 0.2, 0.8)
SAID = "Please take this very nice the cup from the table."


async def performed(
    hub: MemoryHub, *, fault: BodyFault | None = None, moves_to: tuple[float, float, float] = WITHIN_REACH
) -> Summary:
    """Perform a call that points at the cup. moves_to: where it is from half a second on."""
    async with robot(hub, settings=PHYSICAL) as (client, _), perceive("ann", hub=hub) as ann:
        ann.bring(cup(*WITHIN_REACH))
        await ann.look_at(ann.robot)
        await asyncio.sleep(1.0)
        if fault is not None:
            await client.switch_on(fault)
        performing = asyncio.create_task(perform_call(client, CALL))
        await asyncio.sleep(0.5)
        ann.bring(cup(*moves_to))
        return await performing


async def test_it_points_where_nothing_is_wrong(hub: MemoryHub) -> None:
    told = await performed(hub)

    assert [(each.by, each.phrase) for each in told.references] == [("pointing", "this")]


@pytest.mark.parametrize("kind", ["stalled", "weak", "blocked"])
async def test_an_arm_that_makes_no_way_is_not_said_to_point(hub: MemoryHub, kind: str) -> None:
    told = await performed(hub, fault=BodyFault(kind=kind, part="left_arm"))

    assert (told.status, told.said) == ("done", SAID)
    assert [(each.by, each.phrase) for each in told.references] == [("a look", "the cup")]


@pytest.mark.parametrize("kind", ["stalled", "weak"])
async def test_a_head_that_makes_no_way_is_not_said_to_look(hub: MemoryHub, kind: str) -> None:
    told = await performed(hub, fault=BodyFault(kind=kind, part="head"))

    assert (told.status, told.said) == ("done", SAID)
    # The arm had come to its stroke when the head was given up.
    assert [(each.by, each.phrase, each.looked) for each in told.references] == [("pointing", "the cup", None)]
    assert told.eye_contact is None


@pytest.mark.parametrize("place", [(0.05, 0.0, 1.15), (-1.0, 0.2, 0.8), (0.0, 0.0, 2.4)])
async def test_what_comes_to_where_it_cannot_be_shown_is_named(
    hub: MemoryHub, place: tuple[float, float, float]
) -> None:
    told = await performed(hub, moves_to=place)

    assert (told.status, told.said) == ("done", SAID)
    assert [(each.by, each.phrase) for each in told.references] == [("words alone", "the cup")]
