"""The Python of docs/conversations.md does what the page says."""

import asyncio
import re
from pathlib import Path
from typing import Any

import pytest

from engage_hri import embedded, perceive

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "conversations.md").read_text(encoding="utf-8")
EXAMPLE, RULES, GREET, LISTEN = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


def names_of(code: str) -> dict[str, Any]:
    names: dict[str, Any] = {}
    exec(code, names)
    return names


def test_the_ten_lines_are_those_of_the_example() -> None:
    assert EXAMPLE in (ROOT / "examples" / "conversation.py").read_text(encoding="utf-8")
    assert len([line for line in EXAMPLE.splitlines() if line.strip()]) <= 10


async def test_a_turn_greets_and_tells_what_became_of_it(capsys: pytest.CaptureFixture[str]) -> None:
    async with embedded() as robot:
        await robot.person()
        await names_of(GREET)["greet"](robot)

    assert re.match(r"done Hello! .*\? (nod|speak|shake)", capsys.readouterr().out)


async def test_rules_lead_without_a_network_and_what_is_said_is_heard(capsys: pytest.CaptureFixture[str]) -> None:
    async with embedded(human="none") as robot, perceive("ann", hub=robot.hub) as ann:
        await ann.look_at(robot.id)
        tasks = [
            asyncio.create_task(names_of(RULES)["manager"](robot)),
            asyncio.create_task(names_of(LISTEN)["listen"](robot)),
        ]
        with robot.turns() as turns:
            first = await turns.next(10.0)
            await ann.say("The red square.", delay=0.1)
            second = await turns.next(20.0)
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks)

    assert first is not None
    assert second is not None
    assert " ".join(each.text for each in first.spoken) == "Tell me which piece you like."
    assert " ".join(each.text for each in second.spoken).startswith("I see the red square")
    assert "ann to ('robot',) : The red square." in capsys.readouterr().out
