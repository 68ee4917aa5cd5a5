"""The recipe of docs/security.md on three machines, and a stranger on a fourth."""

import asyncio
import re
from pathlib import Path

import pytest

from tests.lab.lab import laboratory, missing
from tests.lab.test_deploy import DOCS, MACHINES, READY
from tests.lab.test_reach import BML, LONG, engage, until

pytestmark = [pytest.mark.real_time, pytest.mark.skipif(bool(missing()), reason=missing())]
PAGE = (DOCS / "security.md").read_text(encoding="utf-8")


def calls(prompt: str) -> list[tuple[str, list[str]]]:
    """Commands of the page behind such a prompt, and for which machine each is."""
    return [(machine, line.split()) for machine, line in re.findall(rf"^({prompt})engage (.*)$", PAGE, re.MULTILINE)]


async def test_three_machines_with_keys_and_a_stranger(tmp_path: Path) -> None:
    (tmp_path / "greeting.xml").write_text(BML)

    def found(word: str) -> str:
        return str(tmp_path / word) if re.fullmatch(r"keys(/\w+)?|.*\.xml", word) else word

    async with laboratory(tmp_path, machines=(1, 2, 3, 4), seed=1) as lab:
        init = next(words for _, words in calls("") if words[:2] == ["keys", "init"])
        process = await engage(lab.machines[1], "keys", *map(found, init[1:]))
        told, _ = await asyncio.wait_for(process.communicate(), LONG)
        assert process.returncode == 0, told.decode()
        (router, first), *others = calls(r"[abc]\$ ")
        routing = await engage(lab.machines[MACHINES[router[0]]], *map(found, first))
        await until(routing, "router is ready")
        played = 0
        for machine, words in others:
            process = await engage(lab.machines[MACHINES[machine[0]]], *map(found, words))
            if words[0] == "play":
                told, _ = await asyncio.wait_for(process.communicate(), LONG)
                assert process.returncode == 0, told.decode()
                played += 1
            else:
                await until(process, READY[words[0]])
        assert played == 1
        endpoint = first[first.index("--listen") + 1]
        await engage(lab.machines[4], "watch", "--robot", "melvin", "--connect", endpoint, "--mode", "client")
        await until(routing, "refused a link")
