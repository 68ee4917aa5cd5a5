"""A fragment that waits for its turn while the world changes."""

import asyncio

from msgspec.structs import replace

from engage_hri.schemas.behaviors import Gaze, Pointing
from engage_hri.schemas.fragments import FragmentOutcome
from engage_hri.schemas.world import COVERED_FOR
from engage_hri.services.bus.memory import MemoryHub
from tests.generation.partners import TABLE, stage
from tests.generation.test_service import refers, says


async def test_what_has_left_the_world_while_the_fragment_waited_is_referred_to_in_words(hub: MemoryHub) -> None:
    """It was there when the fragment was admitted, and is not any more when its turn has come."""
    less = replace(TABLE, entities=tuple(each for each in TABLE.entities if each.id != "middle"))
    async with stage(hub) as partners:
        partners.send(says("first"))
        await partners.fragment_block("first")
        second = partners.send(refers("second"))
        await second.accepted
        partners.see(less)
        await asyncio.sleep(COVERED_FOR + 1.0)
        partners.see(less)
        await asyncio.sleep(0.1)
        partners.end(partners.request("first"))
        block = await partners.fragment_block("second")
        partners.end(partners.request("second"))
        outcome = await second.outcome

    assert isinstance(outcome, FragmentOutcome)
    assert outcome.choices[0].gesture == "none"
    assert not [each for each in block.behaviors if isinstance(each, Gaze | Pointing) and each.target == "middle"]
