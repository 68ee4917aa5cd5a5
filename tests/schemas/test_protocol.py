"""docs/protocol.md says what the code does: it is made from it, it is complete, and its example works."""

import asyncio
import importlib.util
import re
import sys
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import get_args

import msgspec
import pytest

from engage_hri.schemas import keys, lines
from engage_hri.schemas.fragments import PerformFragment
from engage_hri.schemas.messages import Message
from engage_hri.schemas.requests import Accepted
from engage_hri.services.bus.zenoh.hub import open_hub
from tests.bus.places import free_endpoint

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = (DOCS / "protocol.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def protocol() -> ModuleType:
    spec = importlib.util.spec_from_file_location("docs_protocol", DOCS / "protocol.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_is_not_stale(protocol: ModuleType) -> None:
    assert protocol.page() == PAGE, "run python docs/protocol.py"


@pytest.mark.parametrize("message", [kind.__name__ for kind in get_args(Message)])
def test_every_message_has_a_key_and_a_section(message: str, protocol: ModuleType) -> None:
    assert any(f"`{message}`" in messages for _, _, messages in protocol.KEYS)
    assert re.search(rf"^#### {message} · `", PAGE, re.MULTILINE)


def test_every_key_is_in_the_table(protocol: ModuleType) -> None:
    table = {re.sub("<[^>]+>", "x", key) for key, _, _ in protocol.KEYS}

    constants = {
        value.replace("*/*", "x/x")
        for name, value in vars(keys).items()
        if name.isupper() and isinstance(value, str) and value.startswith(keys.PREFIX) and not name.startswith("ANY_")
    }
    makers = (
        keys.cancel, keys.keep_alive, keys.request_state, keys.fault, keys.statistics, keys.status, keys.alive,
        keys.head_pose, keys.voice_activity, keys.open_events,
    )  # fmt: skip
    made = {make("x").replace("*/*", "x/x") for make in makers} | {keys.connection_event("x", "x")}

    assert table == (constants | made) - {keys.PREFIX, keys.EVERYTHING}


@pytest.mark.parametrize("kind", get_args(lines.Told))
def test_the_table_of_json_lines_leads_to_the_message_of_each(kind: type[msgspec.Struct]) -> None:
    name, tag = kind.__name__, kind.__struct_config__.tag

    (link,) = re.findall(rf"^\| [^|]+ \| `{tag}` \| \[`{name}`\]\(#(.*)\) \|$", PAGE, re.MULTILINE)

    assert link == f"{name}--{tag}".lower()
    assert f"#### {name} · `{tag}`\n" in PAGE


@pytest.mark.real_time
async def test_the_example_in_plain_zenoh_reaches_every_process() -> None:
    endpoint = free_endpoint()
    example, _ = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    program = example.replace("tcp/127.0.0.1:7447", endpoint).replace("to_bytes())", "to_bytes(), flush=True)")
    assert endpoint in program

    async with await open_hub("robot", listen=[endpoint]), await open_hub("robot", connect=[endpoint]) as hub:
        bus = hub.join("generation")
        async with asyncio.timeout(20):
            commands = bus.subscribe(keys.commands("generation"))
            guest = await asyncio.create_subprocess_exec(
                sys.executable, "-c", program, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT
            )
            assert guest.stdout is not None
            try:
                received = await commands.next()
                bus.publish(keys.request_state("generation"), Accepted(id="greeting-1"))
                answer = await guest.stdout.readline()
            finally:
                with suppress(ProcessLookupError):
                    guest.kill()
                await guest.wait()

    assert received is not None
    assert isinstance(received.message, PerformFragment)
    assert received.message.fragment.behaviors[0].id == "speech-1"
    assert b"engage.Accepted/1" in answer
    assert b"greeting-1" in answer
