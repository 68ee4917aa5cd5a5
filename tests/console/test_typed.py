"""A line typed for the robot is read as a stream is: it names objects, and what is for the eye is not said."""

import asyncio
import json

import pytest

from engage_hri.schemas.behaviors import Reference, Speech
from engage_hri.schemas.fragments import PerformFragment
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.requests.ends import RequestDesk
from tests.console.test_seats import give, told, visitors


async def typed(hub: MemoryHub, line: str) -> tuple[list[str], str]:
    """Type a line before a world with a cup. Returns what generation is asked for, and what the page is told."""
    async with visitors(hub, windows=1, each=1) as (visitor,):
        generation = hub.join("generation")
        generation.declare_alive()
        await asyncio.sleep(0.1)
        with generation.subscribe(*RequestDesk.patterns("generation")) as inbox:
            give(visitor, json.dumps({"do": "tell", "text": line}))
            await asyncio.sleep(0.2)
            inbox.close()
            asked = [each.message async for each in inbox if isinstance(each.message, PerformFragment)]
        shown = told(visitor)
    parts = []
    for each in asked[0].fragment.behaviors if asked else ():
        assert isinstance(each, Speech | Reference)
        parts.append(each.text if isinstance(each, Speech) else f"<{each.target}>")
    return parts, shown


@pytest.mark.parametrize(
    ("line", "parts", "shown"),
    [
        ("Hello there. How are you?", ["Hello there. How are you?"], ""),
        ("Please take [cup] now.", ["Please take", "<cup>", "now."], ""),
        ("**Take** [CUP]", ["Take", "<cup>"], "ids were written in other letters than the world has: [CUP]"),
        (
            "See [this](https://example.org) and [sic]",
            ["See this and sic"],
            "addresses were not said in full: (https://example.org); "
            "brackets that are no reference were said as words: [sic]",
        ),
        ("[laughs]", [], "nothing to say (stage directions were not said: [laughs])"),
    ],
)
async def test_a_typed_line_is_read_as_a_stream_is(hub: MemoryHub, line: str, parts: list[str], shown: str) -> None:
    assert await typed(hub, line) == (parts, shown)
