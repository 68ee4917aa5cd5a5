"""Levels and reasons of a life of recognition that is broken off at random go on as in one that is not."""

import random
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import EVENT_KINDS, Action
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.recognition import ConnectionEvent, EventState, Statistics
from engage_hri.schemas.units import Probability, Seconds, Stamp
from engage_hri.schemas.world import World
from engage_hri.services.recognition.config import HYSTERESIS, RecognitionConfig
from engage_hri.services.recognition.intake import Content, Intake, Output
from engage_hri.services.recognition.service import FormerLife
from engage_hri.services.recognition.statistics import published
from engage_hri.services.recognition.statistics.published import TOGETHER, PublishedStatistics
from engage_hri.services.runtime.intake import Input, PublishMessage, StepClock
from tests.random_cases import share_of
from tests.recognition.observations import HUMAN, ROBOT, stamp, world

CONFIG = RecognitionConfig()
PEOPLE = ("ann", "bob")


class Counted:
    """Statistics, and what they keep for a next life. path: of the file; empty: there is none."""

    def __init__(self, path: str) -> None:
        self._published, self._file = PublishedStatistics(ROBOT, CONFIG), FormerLife(path)
        for state in self._file.recall():
            if isinstance(state, Statistics):
                self._published.resume(state, state.at.seconds)
            elif isinstance(state, ConnectionEvent):
                self._published.remember(state)

    def feed(self, changes: list[ConnectionEvent], busy: set[str], now: Seconds, **contacts: Probability) -> None:
        for event in changes:
            self._file.keep("", event)
        self._published.feed(changes, busy, now, contacts)
        for told in self._published.told(now):
            self._file.keep(keys.statistics(told.actor or "all"), told)

    def tell(self, now: Seconds) -> list[Statistics]:
        told = [self._published.statistics(actor, now) for actor in (*PEOPLE, TOGETHER)]
        for each in told:
            self._file.keep(keys.statistics(each.actor or "all"), each)
        return told


def news(chance: random.Random, at: Seconds) -> Iterator[tuple[list[ConnectionEvent], set[str], dict[str, float]]]:
    """What happens at one instant: events of one of the two, how much of a contact there is, and who is busy."""
    busy: set[str] = set()
    for number in range(1000):
        changes, contacts = [], {}
        who, what = chance.choice(PEOPLE), chance.random()
        if what < 0.5:
            states: tuple[EventState, ...] = ("started", chance.choice(("succeeded", "failed")))
            kind, initiator = chance.choice(tuple(EVENT_KINDS)), chance.choice((who, ROBOT))
            changes = [
                ConnectionEvent(
                    id=f"{number}", kind=kind, initiator=initiator, responder=ROBOT if initiator == who else who,
                    state=state, at=Stamp("loop", at + number), started=Stamp("loop", at + number), delay=0.5,
                )
                for state in states
            ]  # fmt: skip
        elif what < 0.8:
            contacts = {who: chance.choice((0.0, 0.3, 1.0))}
        else:
            busy = busy ^ {who}
        yield changes, busy, contacts


def numbers(reasons: tuple[str, ...]) -> list[float]:
    return [float(each) for each in re.findall(r"\d+\.?\d*", " ".join(reasons))]


@pytest.mark.parametrize("seed", range(share_of(6)))
def test_what_is_estimated_goes_on_as_without_the_restart(
    tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(published, "TOLD_EVERY", 0.0)
    chance = random.Random(seed)
    one, other, restarts = Counted(""), Counted(f"{tmp_path}/other"), 0
    happens = news(random.Random(seed), 100.0)
    for number in range(150):
        now = 100.0 + number
        changes, busy, contacts = next(happens)
        for life in (one, other):
            life.feed(changes, busy, now, **contacts)
            life.tell(now)
        if chance.random() < 0.1:
            other = Counted(f"{tmp_path}/other")
            other.feed([], busy, now)
            restarts += 1
        left, right = one.tell(now + 0.5), other.tell(now + 0.5)
        for expected, found in zip(left, right, strict=True):
            assert (found.level, found.busy) == (expected.level, expected.busy)
            assert numbers(found.reasons) == pytest.approx(numbers(expected.reasons), abs=0.11)  # 3.75 is 3.7 or 3.8
            assert found.engagement == pytest.approx(expected.engagement)
            assert (found.contact.now, found.contact.ended) == (expected.contact.now, expected.contact.ended)
            assert found.contact.share == pytest.approx(expected.contact.share)
    assert restarts > 5


class Life:
    """A life of recognition that begins at `now` and keeps what it knows in a file.

    killed_after: number of states of the former life after which it is killed while it begins; None: it is not.
    """

    def __init__(self, path: Path, now: Seconds, killed_after: int | None = None) -> None:
        self.now, self.told = now, dict[str, list[Statistics]]()
        self._intake, self._file = Intake(ROBOT, CONFIG, StepClock("loop"), f"at-{now}"), FormerLife(str(path))
        for number, state in enumerate(self._file.recall()):
            if number == killed_after:
                return
            self._note(self._intake.take(Input("", state, "", now), now))
        self._note(self._intake.begin(now))

    def takes(self, message: Content, at: Seconds) -> None:
        self.until(at)
        key = keys.WORLD if isinstance(message, World) else keys.PERCEIVED_ACTION
        self._note(self._intake.take(Input(key, message, "camera", at), at))

    def until(self, end: Seconds) -> None:
        while (due := self._intake.deadline) is not None and due <= end:
            self.now = max(self.now, due)
            self._note(self._intake.advance(self.now))
        self.now = end

    def _note(self, outputs: list[Output]) -> None:
        for output in outputs:
            if isinstance(output, PublishMessage):
                self._file.keep(output.key, output.message)
                if isinstance(output.message, Statistics):
                    self.told.setdefault(output.message.actor, []).append(output.message)

    def levels(self, actor: str) -> list[tuple[float, str]]:
        """Levels as they were told, each from when on."""
        told = [(round(each.at.seconds, 1), each.level) for each in self.told[actor]]
        return [each for before, each in pairwise([(0.0, ""), *told]) if each[1] != before[1]]


def does(action: Action, at: Seconds, *targets: str, actor: str = HUMAN) -> ActionBegan:
    return ActionBegan(actor=actor, action=action, at=stamp(at), targets=targets)


def looked_at(path: Path) -> Life:
    """A life in which she has looked at the robot from 10 to 40."""
    life = Life(path, 0.0)
    life.takes(world(), 0.0)
    life.takes(does("look", 5.0, "table"), 5.0)
    life.takes(does("look", 10.0, ROBOT), 10.0)
    life.until(40.0)
    return life


def test_who_is_eye_in_eye_with_the_robot_is_so_after_a_restart(tmp_path: Path) -> None:
    whole = looked_at(tmp_path / "file")
    life = Life(tmp_path / "file", 41.0)
    for each in (whole, life):
        each.takes(does("look", 60.0, "table"), 60.0)
        each.until(120.0)

    levels = life.levels(HUMAN)
    assert levels[0] == (41.0, "engaged")
    assert [level for _, level in levels] == [level for _, level in whole.levels(HUMAN)[-3:]]
    assert [at for at, _ in levels[1:]] == pytest.approx([at for at, _ in whole.levels(HUMAN)[-2:]], abs=1.0)


def test_a_look_of_a_former_life_is_over_when_nothing_tells_of_it_for_the_window(tmp_path: Path) -> None:
    """From then on there is silence."""
    looked_at(tmp_path / "file")
    life = Life(tmp_path / "file", 41.0)
    life.until(200.0)

    over = 41.0 + CONFIG.window
    silent = CONFIG.reference_mtbce / (CONFIG.engaged_from - HYSTERESIS)
    assert life.levels(HUMAN)[1] == (round(over + silent, 1), "disengaging")


def test_who_is_busy_is_so_after_a_restart(tmp_path: Path) -> None:
    before = looked_at(tmp_path / "file")
    before.takes(does("act", 40.0, "blue-square"), 40.0)
    before.takes(does("look", 40.0, "blue-square"), 40.0)
    before.until(50.0)
    life = Life(tmp_path / "file", 51.0)
    life.takes(does("act", 60.0, "blue-square"), 60.0)
    life.until(89.0)

    assert {(each.level, each.busy) for each in life.told[HUMAN]} == {("engaged", True)}


@pytest.mark.parametrize("killed_after", range(4))
def test_a_life_that_is_killed_while_it_begins_leaves_the_file_to_the_next(tmp_path: Path, killed_after: int) -> None:
    before = looked_at(tmp_path / "file")
    Life(tmp_path / "file", 41.0, killed_after)
    life = Life(tmp_path / "file", 42.0)

    counted = [each.session.events for each in (before.told[HUMAN][-1], life.told[HUMAN][0], life.told[""][0])]
    assert counted == [1, 1, 1]
    assert life.levels(HUMAN) == [(42.0, "engaged")]


def test_who_has_said_a_word_is_not_in_contact_for_ever(tmp_path: Path) -> None:
    """Nobody tells where she looks."""
    life = Life(tmp_path / "file", 0.0)
    life.takes(world(), 0.0)
    life.takes(does("speak", 1.0), 1.0)
    life.takes(ActionEnded(actor=HUMAN, action="speak", at=stamp(2.0)), 2.0)
    life.until(60.0)

    assert [level for _, level in life.levels(HUMAN)] == ["engaging", "engaged", "disengaging", "disengaged"]
