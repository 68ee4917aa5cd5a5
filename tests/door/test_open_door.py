"""The service of the door, but for its socket: what it makes, and tells, as it opens."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.participants import ServiceSettings
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.door import service
from engage_hri.services.door.config import DoorConfig


@asynccontextmanager
async def nowhere(*_: Any) -> AsyncIterator[int]:
    yield 8138


async def test_a_door_that_opens_tells_its_settings_without_the_tokens_that_it_makes_for_each_role(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(service, "serving", nowhere)
    config = DoorConfig(folder=str(tmp_path / "tokens"))
    opened = asyncio.Event()
    async with MemoryHub() as hub:
        with hub.join("viewer").subscribe(keys.settings("door")) as inbox:
            door = asyncio.create_task(service.open_door(hub.join("door"), opened.set, config))
            await opened.wait()
            received = await inbox.next(None)
            door.cancel()
            await asyncio.wait([door])

    assert received is not None
    assert isinstance(received.message, ServiceSettings)
    tokens = {path.name: path.read_text().strip() for path in (tmp_path / "tokens").iterdir()}
    assert tokens.keys() == {*config.roles}
    assert '"roles": ["observer", "manager"]' in received.message.settings
    assert not any(token in received.message.settings for token in tokens.values())
