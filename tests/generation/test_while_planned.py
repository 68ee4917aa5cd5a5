"""What happens while a fragment is planned: an inhibition, a cancellation, a question that takes its time."""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any
from unittest.mock import patch

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gaze, Pointing, Reference, Speech, SpeechOption
from engage_hri.schemas.body import EstimateBehaviors
from engage_hri.schemas.fragments import FragmentOutcome, Inhibit, TurnFragment
from engage_hri.schemas.messages import Message
from engage_hri.services.bus.memory import MemoryHub
from tests.generation import partners as partners_module
from tests.generation.partners import TABLE, Partners, stage

WORDS = SpeechOption(text="the thing over there", cost=4)
THIS = SpeechOption(text="this", cost=1, deictic=True)


def refers(*targets: str) -> TurnFragment:
    """Words need a look, or a point."""
    references = tuple(
        Reference(id=f"ref-{number}", target=target, minimum_reliability=0.85, options=(THIS, WORDS))
        for number, target in enumerate(targets)
    )
    return TurnFragment(id="show", behaviors=(Speech(id="s", text="Take"), *references))


class Interruption:
    """Something that happens while the body takes its time over what comes after the first reference."""

    def __init__(self) -> None:
        self.happens: Callable[[], object] = lambda: None
        self.questions = 0

    def estimates(self, *arguments: object, **named: object) -> Callable[[Message], Coroutine[Any, Any, Message]]:
        answer = ORIGINAL(*arguments, **named)  # type: ignore[arg-type]

        async def told(question: Message) -> Message:
            assert isinstance(question, EstimateBehaviors)
            self.questions += 1
            if self.questions == 2:
                self.happens()
                await asyncio.sleep(0.05)
            made: Message = answer(question)
            return made

        return told


ORIGINAL = partners_module.estimates


async def planned_with(hub: MemoryHub, happens: Callable[[Partners], object]) -> tuple[Partners, object]:
    """The partners once it is over, and the outcome of the fragment, whose block ends as soon as it is there."""
    interruption = Interruption()
    targets = [entity.id for entity in TABLE.objects][:2]
    with patch.object(partners_module, "estimates", interruption.estimates):
        async with stage(hub) as partners:
            interruption.happens = lambda: happens(partners)
            pending = partners.send(refers(*targets))
            await asyncio.sleep(1.0)
            if any(request.block.id == "show" for request in partners.blocks):
                partners.end(partners.request("show"))
            outcome = await pending.outcome
            assert interruption.questions >= 2
            return partners, outcome


async def test_undisturbed_the_robot_looks(hub: MemoryHub) -> None:
    partners, _ = await planned_with(hub, lambda partners: None)

    assert {"ref-0-gaze", "ref-1-gaze"} <= {each.id for each in partners.request("show").block.behaviors}


async def test_what_is_inhibited_while_the_block_is_planned_is_not_in_it(hub: MemoryHub) -> None:
    def inhibits(partners: Partners) -> None:
        for part in ("gaze", "point-left", "point-right"):
            request = Inhibit(id=part, requester=partners.client.name, part=part, ttl=60.0)  # type: ignore[arg-type]
            partners.requests.send(keys.INHIBIT, request)

    partners, outcome = await planned_with(hub, inhibits)

    behaviors = partners.request("show").block.behaviors
    assert not [each for each in behaviors if isinstance(each, Gaze | Pointing)]
    assert [each.text for each in behaviors if isinstance(each, Speech)] == ["Take", WORDS.text, WORDS.text]
    assert partners.aborts == []
    assert isinstance(outcome, FragmentOutcome)


async def test_a_fragment_that_is_cancelled_while_it_is_planned_sends_no_block(hub: MemoryHub) -> None:
    def cancels(partners: Partners) -> None:
        partners.requests.cancel("ask-show", "changed my mind")

    partners, outcome = await planned_with(hub, cancels)

    assert [request.block.id for request in partners.blocks if request.block.id == "show"] == []
    assert isinstance(outcome, FragmentOutcome)
    assert outcome.status == "interrupted"
