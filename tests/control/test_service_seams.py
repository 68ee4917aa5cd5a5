"""Control where two mean the same behavior, and with a driver whose numbers are of other types."""

import asyncio
from collections.abc import AsyncGenerator
from contextlib import aclosing
from functools import partial
from typing import Any

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Pointing, Speech
from engage_hri.schemas.body import AbortBehavior, BehaviorOutcome, PerformBehavior
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.body import Spoke
from engage_hri.services.control.service import embody
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.requests.ends import Requester
from engage_hri.services.runtime.service import running
from tests.control.directing import robot

POINT = Pointing(id="point-1", target="near-right")


async def test_an_abort_of_two_behaviors_of_one_name_ends_with_the_last_of_them(hub: MemoryHub):
    """Two requesters perform what they call the same; both end before the abort does, and it ends once."""
    async with robot(hub) as client:
        other = hub.join("other")
        async with Requester(other) as requests:
            first = client.perform(POINT, "stroke")
            speech = Speech(id="point-1", text="one two three four five six seven")
            twin = PerformBehavior(id="twin", block="block-1", behavior=speech, through="end")
            second = requests.send(keys.BEHAVIOR, twin)
            await asyncio.sleep(1.0)
            abort = AbortBehavior(id="stop", block="block-1", behavior="point-1")
            stopped = client.requests.send(keys.BEHAVIOR, abort)
            await stopped.outcome
            ended = [await client.outcome(each) for each in (first, second) if each.outcome.done()]
        await other.leave()

    assert [outcome.status for outcome in ended] == ["aborted", "aborted"]


class Chatty(SimulatedBody):
    """Its SDK gives positions as text."""

    async def perform(self, behavior: Any, authority: Any) -> AsyncGenerator[Any, None]:
        async with aclosing(super().perform(behavior, authority)) as stream:
            async for progress in stream:
                yield replace(progress, position=str(progress.position)) if isinstance(progress, Spoke) else progress


async def test_positions_of_words_may_be_of_any_type_that_is_a_number(hub: MemoryHub):
    services = {"control": partial(embody, config=ControlConfig(), body=Chatty())}
    async with running(hub, services), Requester(hub.join("realizer")) as requests:
        speech = PerformBehavior(id="s", block="b", behavior=Speech(id="s", text="one two"), through="end")
        outcome = await requests.send(keys.BEHAVIOR, speech).outcome

    assert isinstance(outcome, BehaviorOutcome)
    assert (outcome.status, outcome.spoken) == ("done", "one two")
