"""The service on a memory bus: fragment to block to outcome, refusals, turns, inhibition, in exact virtual time."""

import asyncio

from schemas.behaviors import Reference, Speech, SpeechOption
from schemas.blocks import SpokenText
from schemas.fragments import FragmentOutcome, TurnFragment
from services.memory_bus import MemoryHub
from tests.generation.partners import stage

HELLO = TurnFragment(id="hello", behaviors=(Speech(id="s", text="Hello"),))


def refers(id: str = "show", minimum: float = 0.95, **fields: object) -> TurnFragment:
    return TurnFragment(
        id=id,
        behaviors=(
            Speech(id="s", text="Take"),
            Reference(
                id="ref",
                target="middle",
                minimum_reliability=minimum,
                options=(SpeechOption(text="this", cost=1, deictic=True),),
            ),
        ),
        **fields,  # type: ignore[arg-type]
    )


async def test_a_fragment_becomes_a_block_and_the_block_an_outcome(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        pending = partners.send(refers())
        block = await partners.fragment_block("show")
        partners.reach("show", "ref-event", "start")
        partners.event("e", "started", block="show", behavior="ref-event")
        partners.end(partners.request("show"), spoken=(SpokenText(behavior="s", text="Take"),))
        await asyncio.sleep(1.0)
        undecided = pending.outcome.done()
        partners.event("e", "succeeded", block="show", behavior="ref-event", delay=0.4)
        outcome = await pending.outcome

        assert [type(behavior).__name__ for behavior in block.behaviors] == [
            "Event", "Speech", "Gaze", "Pointing", "Speech", "Event", "Gaze", "Event", "TurnSignal",
        ]  # fmt: skip
        assert not undecided
        assert isinstance(outcome, FragmentOutcome)
        assert (outcome.status, outcome.fragment) == ("done", "show")
        assert [event.state for event in outcome.events] == ["succeeded"]
        assert outcome.choices[0].gesture == "directed_gaze_with_pointing"
        assert outcome.spoken == (SpokenText(behavior="s", text="Take"),)
        assert asyncio.get_running_loop().time() == 1.0
