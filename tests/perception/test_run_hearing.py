"""`engage run hearing --from FILE`: a process that hears a file, tells it on Zenoh, and ends with it."""

import json
from pathlib import Path

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActorLost, Utterance
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.runtime.service import running
from tests.bus.places import free_endpoint
from tests.cli.command import engage, start
from tests.perception.spoken import PHRASES, spoken, write_wav
from tests.perception.test_hearing import idle

pytestmark = pytest.mark.real_time


async def test_a_file_is_heard_by_a_process_that_ends_with_it(tmp_path: Path):
    pytest.importorskip("pocketsphinx", reason="pip install pocketsphinx")
    endpoint = free_endpoint()
    path = write_wav(tmp_path / "said.wav", spoken("the blue one").samples)
    hub = await open_hub("heard", listen=(endpoint,))
    async with hub, running(hub, {"recognition": idle}):
        with hub.join("watcher", role="observer").subscribe(keys.UTTERANCE, keys.PERCEIVED_ACTION) as inbox:
            process = await start(
                "run", "hearing", "--from", path, "--robot", "heard", "--connect", endpoint,
                "--set", "hearing.recognizer=sphinx", "--set", f"hearing.phrases={json.dumps(PHRASES)}",
            )  # fmt: skip
            told = []
            async for received in inbox:
                told.append(received.message)
                if isinstance(received.message, ActorLost):
                    break
            _, errors = await process.communicate()

    assert process.returncode == 0, errors.decode()
    assert [each.text for each in told if isinstance(each, Utterance) and each.final] == ["the blue one"]


def test_a_source_is_for_hearing_alone(capsys: pytest.CaptureFixture[str]):
    told = engage(capsys)("run", "realizer", "--from", "said.wav")
    assert (told.code, "--from is for hearing, eyes or pieces" in told.err) == (2, True)
