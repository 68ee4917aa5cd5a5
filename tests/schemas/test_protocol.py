"""docs/protocol.md says what the code does: its tables are complete, its numbers right, and its example works."""

import asyncio
import re
import sys
from contextlib import suppress
from pathlib import Path
from typing import get_args

import msgspec
import pytest

from engage_hri.schemas import keys, messages
from engage_hri.schemas.export import ID
from engage_hri.schemas.fragments import PerformFragment
from engage_hri.schemas.messages import COMMANDS, OUTWARD, Message
from engage_hri.schemas.requests import Accepted, Request
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.bus.zenoh.order import KEPT
from engage_hri.services.requests.serving import LIFELESS_KEPT
from tests.bus.places import free_endpoint

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = (DOCS / "protocol.md").read_text(encoding="utf-8")


KEY_ROWS = re.findall(r"^\| `(engage/v1/[^`]+)` \| [^|]+ \| (.+) \|$", PAGE, re.MULTILINE)


@pytest.mark.parametrize("message", [kind.__name__ for kind in get_args(Message)])
def test_every_message_has_a_key(message: str) -> None:
    assert any(f"`{message}`" in messages for _, messages in KEY_ROWS)


@pytest.mark.parametrize(("expression", "kinds"), COMMANDS.items())
def test_a_command_key_takes_what_the_page_says(expression: str, kinds: tuple[type[Request], ...]) -> None:
    key = expression.replace("*/*", "<role>/<requester>")

    assert dict(KEY_ROWS)[key] == ", ".join(f"`{kind.__name__}`" for kind in kinds)


def test_every_key_is_in_the_table() -> None:
    table = {re.sub("<[^>]+>", "x", key) for key, _ in KEY_ROWS}

    constants = {
        value.replace("*/*", "x/x")
        for name, value in vars(keys).items()
        if name.isupper() and isinstance(value, str) and value.startswith(keys.PREFIX) and not name.startswith("ANY_")
    }
    makers = (
        keys.cancel, keys.keep_alive, keys.request_state, keys.fault, keys.statistics, keys.status,
        keys.head_pose, keys.looked, keys.voice_activity, keys.landmarks, keys.sound, keys.open_events,
        keys.interjection, keys.settings, keys.taken,
    )  # fmt: skip
    made = {make("x").replace("*/*", "x/x") for make in makers}
    made |= {keys.connection_event("x", "x"), keys.perceived_ongoing("x", "x"), keys.alive("x", "x")}  # type: ignore[arg-type]

    assert table == (constants | made) - {keys.PREFIX, keys.EVERYTHING}


@pytest.mark.parametrize(
    "said",
    [
        f"a late subscriber gets the last {keys.HISTORY_MAX_AGE:g} s",
        f"or any part of them | the last {keys.HISTORY_MAX_AGE:g} s",
        f"ended requests are remembered for {LIFELESS_KEPT:g} s",
        f"a process keeps its last {KEPT}",
        f"The role is one of {', '.join(f'`{role}`' for role in keys.ROLES)};",
        f"JSON where programs of others read most: {', '.join(f'`{kind.__name__}`' for kind in OUTWARD[:-1])} and"
        f" `{OUTWARD[-1].__name__}`",
        f"`<robot>/{keys.own('<run>', 'alive/<part>/<name>/<clock>')}`",
        f"`<robot>/{keys.status('*')}?format=json`",
        f"`{ID}#PerformFragment`",
        *(f"`<robot>/{keys.of_class(kind)}`" for kind in ("state", "evt", "cmd")),
    ],
)
def test_numbers_and_names_are_those_of_the_code(said: str) -> None:
    assert " ".join(said.split()) in " ".join(PAGE.split())


@pytest.mark.parametrize("kind", get_args(messages.LineMessage))
def test_the_table_of_json_lines_names_the_message_of_each(kind: type[msgspec.Struct]) -> None:
    name, tag = kind.__name__, kind.__struct_config__.tag

    (written,) = re.findall(rf"^\| [^|]+ \| `{tag}` \| `(.*)` \|$", PAGE, re.MULTILINE)

    assert written == name


@pytest.mark.real_time
async def test_the_example_in_plain_zenoh_reaches_every_process() -> None:
    endpoint = free_endpoint()
    example, *_ = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
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
