"""Tiers of real runs and of random recordings, against an oracle that reads the file with the plain library."""

import asyncio
import random
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import BlockProgress, SyncPointProgress
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.fragments import Claim, HeadOwner
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, Utterance
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.interface import Sample
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.recording.disk import read
from engage_hri.services.recording.tiers import tiers
from engage_hri.services.reports.ongoing_actions import OngoingActionTracker
from engage_hri.services.runtime.service import running
from engage_hri.services.tangram.people.config import SimulationConfig
from tests.recording.conftest import Anchor
from tests.recording.files import bytes_of, sample
from tests.recording.oracle import Oracle, Stretch
from tests.recording.runs import recording_to

PEOPLE, THINGS = ("ann", "bob"), ("cup", "plate", "robot")


def made(path: Path) -> list[Stretch]:
    """What our tiers say, without the numbers of second ones."""
    return [
        (tier.actor, re.sub(r" \d+$", "", tier.name.removeprefix(f"{tier.actor} ")), one.begin, one.end, one.value)
        for tier in tiers(read(path))
        for one in tier.annotations
    ]


def differences(path: Path) -> list[Stretch]:
    """What only one of the two says."""
    ours, its = (
        Counter((*one[:2], round(one[2], 5), round(one[3], 5), one[4]) for one in each)
        for each in (made(path), Oracle(path).stretches())
    )
    return [*(ours - its), *(its - ours)]


def test_the_tiers_of_a_task_are_those_of_the_oracle(anchor: Anchor) -> None:
    assert len(made(anchor.path)) > 500
    assert not differences(anchor.path)


@pytest.mark.parametrize(("begin", "seconds"), [(10.3, 20.0), (40.2, 30.0)])
async def test_so_are_those_of_a_recorder_that_comes_late_and_ends_early(
    tmp_path: Path, begin: float, seconds: float
) -> None:
    config = Config(simulation=SimulationConfig(human="stochastic", seed=2))
    services = {name: roster.service(name, config) for name in roster.PLAY}
    async with MemoryHub() as hub, running(hub, services):
        await asyncio.sleep(begin)
        async with recording_to(tmp_path / "a.mcap", hub):
            await asyncio.sleep(seconds)

    found = made(tmp_path / "a.mcap")
    assert len(found) > 60
    assert any(one[1:3] == ("present", 0.0) for one in found)
    assert not differences(tmp_path / "a.mcap")


class Story:
    """Random messages of people, robot and recognition, from programs that die and come again."""

    def __init__(self, seed: int) -> None:
        self.chance = random.Random(seed)
        self.at = 0.0
        self.lives = {"camera": 1, "control": 1, "recognition": 1, "realizer": 1, "generation": 1}
        self.trackers = {name: OngoingActionTracker() for name in self.lives}
        self.there: set[str] = set()
        self.events: dict[str, ConnectionEvent] = {}
        self.number = 0
        self.speaks = False

    def samples(self, count: int) -> Iterator[Sample]:
        for name in self.lives:
            yield from self.comes(name)
        for _ in range(count):
            self.at += self.chance.choice([0.0, 0.01, 0.3, 1.0])
            yield from self.step()

    def told(self, name: str, key: str, message: Message) -> Sample:
        self.number += 1
        late = {"camera": 0.02, "recognition": 0.03}.get(name, 0.0)  # in order, each for itself
        return sample(key, message, self.at + late, source=name, life=f"{name}{self.lives[name]}", number=self.number)

    def stamp(self) -> Stamp:
        return Stamp("loop", self.at)

    def comes(self, name: str) -> Iterator[Sample]:
        self.there.add(name)
        yield self.told(name, keys.alive(name), PeerAlive(participant=name, run=f"{name}{self.lives[name]}"))

    def goes(self, name: str) -> Iterator[Sample]:
        self.there.discard(name)
        yield self.told(name, keys.alive(name), PeerGone(participant=name))
        if self.chance.random() < 0.6:  # else it was only cut off
            self.lives[name] += 1
            self.trackers[name] = OngoingActionTracker()
            self.speaks = self.speaks and name != "control"
            if name == "recognition":
                self.events.clear()

    def step(self) -> Iterator[Sample]:
        name = self.chance.choice([*self.lives])
        if name not in self.there:
            yield from self.comes(name)
        elif self.chance.random() < 0.05:
            yield from self.goes(name)
        elif name in ("camera", "control"):
            yield from self.acts(name)
        elif name == "recognition":
            yield from self.recognizes()
        elif name == "realizer":
            yield from self.performs()
        else:
            kind, target = self.chance.choice([("face", "ann"), ("face", "bob"), ("none", "")])
            owner = Claim(kind=kind, target=target, priority=1)  # type: ignore[arg-type]
            yield self.told(name, keys.HEAD_OWNER, HeadOwner(owner=owner, since=self.stamp()))

    def acts(self, name: str) -> Iterator[Sample]:
        chance, is_robot = self.chance, name == "control"
        if is_robot and self.speaks and chance.random() < 0.5:
            word = WordSpoken(block="b", behavior="s", word=chance.choice("xyz"), position=3, at=self.stamp())
            yield self.told(name, keys.SYNC_POINT, word)
            return
        actor = "robot" if is_robot else chance.choice(PEOPLE)
        if not is_robot and chance.random() < 0.2:
            yield self.says(actor)
            return
        if not is_robot and chance.random() < 0.3:
            kind = chance.choice([ActorFound, ActorLost])
            event = kind(actor=actor, at=self.stamp())
        else:
            what = chance.choice(["look", "look", "speak", "point", "act", "nod"])
            targets = (chance.choice(THINGS),) if what in ("look", "point", "act") and chance.random() < 0.8 else ()
            event = chance.choice([ActionBegan, ActionBegan, ActionEnded])(
                actor=actor, action=what, at=self.stamp(), targets=targets, behavior="b:s" if is_robot else "",
            )  # fmt: skip
        key, state = (keys.ROBOT_ACTION, keys.ROBOT_ONGOING) if is_robot else (
            keys.PERCEIVED_ACTION, keys.perceived_ongoing("camera", actor))  # fmt: skip
        if is_robot and event.action == "speak":
            self.speaks = isinstance(event, ActionBegan)
        elif chance.random() < 0.9:  # else it is missing in the recording, and the state tells
            yield self.told(name, key, event)
        if chance.random() < 0.1 or (is_robot and event.action == "speak"):
            yield self.told(name, key, event)
        for ongoing in self.trackers[name].feed([event], self.stamp()):
            yield self.told(name, state, ongoing)

    def says(self, actor: str) -> Sample:
        chance = self.chance
        began = self.at - chance.choice([0.5, 2.0])
        said = Utterance(
            actor=actor, id=f"u{chance.randrange(6)}", text=chance.choice(["", "سلام", "yes\n", "No.\u202e"]),
            final=chance.random() < 0.7, began=Stamp("loop", began), at=Stamp("loop", self.at),
            ended=chance.choice([None, Stamp("loop", began + 0.4)]),
        )  # fmt: skip
        return self.told("camera", keys.UTTERANCE, said)

    def recognizes(self) -> Iterator[Sample]:
        chance, session = self.chance, f"r{self.lives['recognition']}"
        known = chance.choice([*self.events.values(), None])
        if known is None:
            self.number += 1
            event = ConnectionEvent(
                id=f"{session}-{self.number}", kind="backchannel", initiator="robot", responder=chance.choice(PEOPLE),
                state="started", at=self.stamp(), started=Stamp("loop", self.at - chance.choice([0.0, 0.4])),
            )  # fmt: skip
        elif known.state in ("failed", "completed", "lost"):
            event = ConnectionEvent(**{**as_fields(known), "retold": True, "words": "late", "at": self.stamp()})
        else:
            state = chance.choice(["succeeded", "failed", "completed", "lost"])
            event = ConnectionEvent(**{**as_fields(known), "state": state, "at": self.stamp(), "delay": 0.25})
        self.events[event.id] = event
        yield self.told("recognition", keys.connection_event(event.responder, event.kind), event)

    def performs(self) -> Iterator[Sample]:
        chance, block = self.chance, self.chance.choice("bc")
        if chance.random() < 0.5:
            message: Message = BlockProgress(
                block=block, progress=chance.choice(["start", "end"]), at=self.stamp(), status="done"
            )  # fmt: skip
        else:
            message = SyncPointProgress(
                block=block, behavior="s", sync=chance.choice(["start", "stroke", "end"]), at=self.stamp(), time=0.0,
                predicted=0.0, source="body",
            )  # fmt: skip
        yield self.told("realizer", keys.FEEDBACK, message)


def as_fields(event: ConnectionEvent) -> dict[str, object]:
    return {name: getattr(event, name) for name in event.__struct_fields__}


@pytest.mark.parametrize("seed", range(40))
def test_the_tiers_of_random_recordings_are_those_of_the_oracle(tmp_path: Path, seed: int) -> None:
    path = tmp_path / "a.mcap"
    samples = sorted(Story(seed).samples(150), key=lambda one: one.at)
    path.write_bytes(bytes_of(samples, 20))

    assert not differences(path)
