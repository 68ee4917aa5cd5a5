"""Whose voice it is, of several people: by lips that move with it, drawn and rendered, and told by their ids."""

import asyncio
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from engage_hri import embedded
from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActionBegan, ActorFound, ActorLost, HeadPose, Utterance
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.people.perceive import perceive
from engage_hri.services.perception.hearing.config import HearingConfig
from engage_hri.services.perception.hearing.intake import LOOK_AROUND
from engage_hri.services.perception.hearing.lips import Lips
from engage_hri.services.perception.hearing.service import hear
from engage_hri.services.perception.hearing.voice import RATE, Samples
from engage_hri.services.runtime.service import running
from tests.perception.spoken import PHRASES, VOICES, Spoken, spoken, write_wav
from tests.perception.test_hearing import ASKED, hearing, sphinx

PICTURES = 15.0
SHUT, WIDE, NOISE = 0.009, 0.03, 0.0015
"""Gap of closed lips, by how much speech opens them, and its noise, as rendered people have them."""
Mouth = Callable[[float], float]
"""Share by which a mouth is open at a time."""


def loudness(samples: Samples, at: float) -> float:
    """How loud it is around a time, as a share of the loudest."""
    level = np.sqrt(np.convolve(samples.astype(float) ** 2, np.ones(800) / 800, "same"))
    place = round(at * RATE)
    return float(level[place] / level.max()) if 0 <= place < len(level) else 0.0


def speaks(said: Spoken, lead: float = 0.03) -> Mouth:
    return lambda at: loudness(said.samples, at + lead)


def keeps_still(at: float) -> float:
    return 0.0


def chews(rate: float, phase: float) -> Mouth:
    return lambda at: 0.5 + 0.5 * float(np.sin(2 * np.pi * rate * at + phase))


def smiles(since: float) -> Mouth:
    return lambda at: float(np.clip((at - since) / 0.3, 0, 1))


def judged(said: Spoken, mouths: dict[str, Mouth], until: float, seed: int) -> str:
    """Let lips be seen with the sound until a time. Returns whose voice it is then."""
    lips, chance = Lips(), np.random.default_rng(seed)
    lips.hear(said.samples[: round(until * RATE)], 0.0)
    for number in range(int((until - 0.06) * PICTURES)):
        at = number / PICTURES
        for who, mouth in mouths.items():
            gap = SHUT + WIDE * mouth(at) + chance.normal(0, NOISE)
            lips.see(who, max(0.0, gap), at)
    return lips.speaker(said.since, until)


@pytest.mark.parametrize("variant", VOICES)
@pytest.mark.parametrize("other", ["still", "chews", "smiles"])
def test_it_is_that_of_whose_lips_go_with_it_and_hardly_ever_anothers(variant: str, other: str):
    told = []
    for seed, text in enumerate(PHRASES):
        said = spoken(text, variant)
        chance = np.random.default_rng(seed)
        another: Mouth = {
            "still": keeps_still, "chews": chews(chance.uniform(1.2, 2.5), chance.uniform(0, 6)),
            "smiles": smiles(said.since + chance.uniform(-0.5, 0.5)),
        }[other]  # fmt: skip
        told.append(judged(said, {"ann": speaks(said), "ben": another}, said.until + 0.2, seed))

    print(told)
    assert told.count("ben") == 0
    assert told.count("ann") >= {"still": 10, "chews": 8, "smiles": 8}[other]


def test_it_is_known_soon_after_the_onset_where_the_other_keeps_still():
    said = spoken("move the purple triangle to the top")

    assert judged(said, {"ann": speaks(said), "ben": keeps_still}, said.since + 0.45, 1) == "ann"


def test_it_is_nobodys_where_no_lips_move_and_of_two_who_move_alike():
    said = spoken("what is the next piece")

    assert judged(said, {"ann": keeps_still, "ben": keeps_still}, said.until, 1) == ""
    assert judged(said, {"ann": speaks(said), "ben": speaks(said)}, said.until, 1) == ""
    assert judged(said, {}, said.until, 1) == ""


# -- by the service ------------------------------------------------------------------------------------------------


async def seen(bus: Bus, ready: Callable[[], None], mouths: dict[str, Mouth], begin: float) -> None:
    """Eyes that see these lips, from a time of the loop on."""
    ready()
    while True:
        at = bus.now()
        for who, mouth in mouths.items():
            pose = HeadPose(
                actor=who, position=(1.3, 0.0, 1.2), direction=(-1.0, 0.0, 0.0), at=bus.stamp(at),
                mouth=SHUT + WIDE * mouth(at - begin),
            )  # fmt: skip
            bus.publish(keys.head_pose(who), pose)
        await asyncio.sleep(1 / PICTURES)


async def test_the_voice_of_one_of_two_is_told_at_once_and_whose_it_is_as_soon_as_it_is_known(
    hub: MemoryHub, tmp_path: Path
):
    said = spoken("the blue one", before=2.0)
    path = write_wav(tmp_path / "said.wav", said.samples)

    begin = asyncio.get_running_loop().time() + LOOK_AROUND
    eyes = partial(seen, mouths={"ann": keeps_still, "ben": speaks(said)}, begin=begin)
    async with (
        hearing(hub, eyes, source=str(path), **sphinx()) as heard, perceive("ann", hub=hub), perceive("ben", hub=hub)
    ):  # fmt: skip
        await heard.over.wait()

    [(who, since, _)] = heard.speeches
    assert who == "voice_1"
    assert since == pytest.approx(said.since, abs=0.05)
    found = [(each.actor, each.same_as) for each in heard.of(ActorFound) if each.actor.startswith("voice")]
    assert found == [("voice_1", "voice_1"), ("voice_1", "ben")]
    assert {each.actor for each in heard.of(Utterance)} == {"voice_1"}
    assert not [each for each in heard.of(ActorLost) if each.actor == "voice_1"]


async def test_a_voice_whose_lips_nobody_sees_move_stays_a_strangers_and_goes(hub: MemoryHub, tmp_path: Path):
    said = spoken("the blue one", before=2.0, after=2.0)
    path = write_wav(tmp_path / "said.wav", said.samples)

    eyes = partial(seen, mouths={"ann": keeps_still, "ben": keeps_still}, begin=0.0)
    async with hearing(hub, eyes, source=str(path)) as heard, perceive("ann", hub=hub), perceive("ben", hub=hub):
        await heard.over.wait()

    assert [each.actor for each in heard.of(ActionBegan, action="speak")] == ["voice_1"]
    assert [each.actor for each in heard.of(ActorLost)][:1] == ["voice_1"]


async def test_who_answers_the_robot_by_voice_is_told_by_the_id_of_their_face(tmp_path: Path):
    """The robot asks one of two; the answer comes by one microphone."""
    said = spoken("the blue one", before=4.0, after=3.0)
    config = HearingConfig(source=str(write_wav(tmp_path / "said.wav", said.samples)), **sphinx())

    async with embedded(human="none") as robot, perceive("ann", hub=robot.hub), perceive("ben", hub=robot.hub):
        begin = asyncio.get_running_loop().time() + LOOK_AROUND
        eyes = partial(seen, mouths={"ann": speaks(said), "ben": keeps_still}, begin=begin)
        services = {"hearing": partial(hear, config=config), "eyes": eyes}
        async with running(robot.hub, services):
            await asyncio.sleep(1.0)
            outcome = await robot.perform({**ASKED, "addressee": "ann"}, await_answer=True)
            await asyncio.sleep(1.0)

    [answered] = [event for event in outcome.events if event.kind == "adjacency_pair"]
    assert (answered.state, answered.responder, answered.words) == ("completed", "ann", "the blue one")
