"""All that the window shows of a whole recorded scenario, recomputed slowly from the bytes of its messages.

Nothing here comes from the console: each figure is found anew, at each time, from all messages that had come then.
"""

import json
import random
from collections import Counter, defaultdict
from itertools import pairwise
from typing import Any, NamedTuple

import msgspec
import pytest

from engage_hri.services.console.terminal import tally
from engage_hri.services.console.web.picture import Picture
from engage_hri.services.console.web.played import PlayedPicture
from engage_hri.services.recording.reading import Recording
from tests.recording.conftest import Anchor

OVER = {"failed", "completed", "lost", "preempted", "withdrawn", "superseded"}
"""States after which nothing more is told of a connection event."""
EVENTS_SHOWN, SHOWN_FOR = 80, 90.0


class Raw(NamedTuple):
    """A message as plain values. came: time at which it came, from the beginning of the recording."""

    came: float
    key: str
    body: dict[str, Any]


@pytest.fixture(scope="module")
def raw(anchor: Anchor) -> list[Raw]:
    recording, found = anchor.recording, []
    for number in range(len(recording)):
        if not recording.key(number):
            continue
        sample = recording.sample(number)
        is_json = sample.encoding.startswith("application/json")
        body = json.loads(sample.payload) if is_json else msgspec.msgpack.decode(sample.payload)
        found.append(Raw(recording.time(number), sample.key, body))
    return found


class Oracle:
    """The messages that had come by a time. zero: instant that counts as zero."""

    def __init__(self, raw: list[Raw], zero: float, until: float) -> None:
        self._raw = [each for each in raw if each.came <= until]
        self._zero = zero

    def time(self, stamp: list[Any]) -> float:
        return round(stamp[1] - self._zero, 3)

    def of(self, kind: str) -> list[dict[str, Any]]:
        return [each.body for each in self._raw if each.body["type"] == kind]

    def head(self) -> tuple[Any, ...]:
        """Kind, target and reason of the owner, since when, and who waits with what reason."""
        last = self.of("head_owner")[-1]

        def claim(one: dict[str, Any]) -> tuple[str, str, str]:
            return one["kind"], one.get("target", ""), one.get("reason", "")

        return claim(last["owner"]), self.time(last["since"]), [claim(one) for one in last.get("waiting", [])]

    def stories(self) -> dict[str, list[dict[str, Any]]]:
        """The changes of each connection event, without those that are told again."""
        stories = defaultdict(list)
        for change in self.of("connection_event"):
            if not change.get("retold"):
                stories[change["id"]].append(change)
        return stories

    def events(self) -> list[tuple[Any, ...]]:
        """Id, decision, delay, and times of beginning, decision and end of those that are shown."""
        rows = []
        for id, story in self.stories().items():
            decided = next((one for one in story if one["state"] != "started"), None)
            over = next((one for one in story if one["state"] in OVER), None)
            rows.append(
                (
                    id, decided["state"] if decided else "started", decided.get("delay") if decided else None,
                    self.time(story[0]["at"]), self.time(decided["at"]) if decided else None,
                    self.time(over["at"]) if over else None,
                )
            )  # fmt: skip
        last = max((self.time(one["at"]) for one in self.of("connection_event")), default=0.0)
        return [row for row in rows if row[5] is None or last - row[5] <= SHOWN_FOR][-EVENTS_SHOWN:]

    def counts(self, robot: str) -> Counter[tuple[str, bool, str]]:
        """Number of events by kind, whether the robot began them, and decision; optional failures are apart."""
        counted: Counter[tuple[str, bool, str]] = Counter()
        for story in self.stories().values():
            decided = next((one for one in story if one["state"] != "started"), story[0])
            state = "succeeded" if decided["state"] == "completed" else decided["state"]
            state += " optional" if state == "failed" and decided.get("optional") else ""
            counted[decided["kind"], decided["initiator"] == robot, state] += 1
        return counted

    def time_between(self) -> float:
        """Mean time between the beginnings of all connection events."""
        starts = sorted(story[0]["started"][1] for story in self.stories().values())
        gaps = [later - earlier for earlier, later in pairwise(starts)]
        return sum(gaps) / len(gaps)

    def blocks(self) -> dict[str, tuple[Any, ...]]:
        """Beginning, end and status of each block that has begun, and when its sync points were measured."""
        begun = {
            one["block"]: one["at"][1] - one.get("time", 0.0)
            for one in self.of("block_progress")
            if one["progress"] == "start"
        }
        ends = {one["block"]: one for one in self.of("block_progress") if one["progress"] == "end"}
        points: dict[str, dict[tuple[str, str], float]] = defaultdict(dict)
        for one in self.of("sync_point_progress"):
            if one["block"] in begun:
                measured = begun[one["block"]] + one["time"] - self._zero
                points[one["block"]][one["behavior"], one["sync"]] = round(measured, 3)
        return {
            id: (
                round(since - self._zero, 3), self.time(ends[id]["at"]) if id in ends else None,
                ends[id].get("status", "done") if id in ends else "", points[id],
            )
            for id, since in begun.items()
        }  # fmt: skip


def shown(picture: Picture, name: str) -> Any:
    return json.loads(picture.section(name))


def head_shown(picture: Picture) -> tuple[Any, ...]:
    def claim(one: dict[str, Any]) -> tuple[str, str, str]:
        return one["kind"], one["target"], one["reason"]

    head = shown(picture, "head")
    return claim(head["owner"]), head["since"], [claim(one) for one in head["waiting"]]


def lane_shown(picture: Picture, name: str) -> tuple[Any, ...]:
    lane = shown(picture, name)
    measured = {
        (behavior["id"], point["sync"]): point["measured"]
        for behavior in lane["behaviors"]
        for point in behavior["points"]
        if point["measured"] is not None
    }
    return lane["since"], lane["until"], lane["status"], measured


@pytest.mark.parametrize("seed", range(3))
def test_at_any_time_the_window_shows_what_all_messages_so_far_come_to(
    task: Recording, raw: list[Raw], seed: int
) -> None:
    chance = random.Random(seed)
    for at in sorted(chance.uniform(3.0, task.duration) for _ in range(6)):
        playing = PlayedPicture(task, 0.0)
        playing.advance(at)
        picture, oracle = playing.picture, Oracle(raw, task.began, at)

        assert head_shown(picture) == oracle.head()
        assert [
            (each["id"], each["state"], each["delay"], each["since"], each["decided"], each["until"])
            for each in shown(picture, "events")
        ] == oracle.events()
        blocks = oracle.blocks()
        names = [name for name in picture.versions if name.startswith("block/")]
        there = {id for id, (_, until, _, _) in blocks.items() if until is None or at - until < SHOWN_FOR - 0.1}
        assert {name.removeprefix("block/") for name in names} >= there
        for name in names:
            since, until, status, measured = lane_shown(picture, name)
            expected = blocks[name.removeprefix("block/")]
            assert (since, until, status) == pytest.approx(expected[:3], abs=2e-3)
            assert measured == pytest.approx(expected[3], abs=2e-3)


def test_the_figures_at_the_end_are_those_of_all_messages(anchor: Anchor, task: Recording, raw: list[Raw]) -> None:
    playing, oracle = PlayedPicture(task, 0.0), Oracle(raw, task.began, task.duration)
    playing.advance(task.duration + 1.0)
    playing.advance(task.duration + 3.0)
    told = tally.empty(0.0)
    for message, at in anchor.told:
        told = tally.feed(told, message, at)

    counts = oracle.counts(task.robot)
    assert counts.total() > 40
    for kind, by_robot in {(kind, by_robot) for kind, by_robot, _ in counts}:
        row = tally.count(told, kind, task.robot if by_robot else None, task.robot)  # type: ignore[arg-type]
        rest = [state for k, by, state in counts.elements() if (k, by) == (kind, by_robot)]
        assert row.succeeded == rest.count("succeeded")
        assert (row.failed, row.failed_optional) == (rest.count("failed"), rest.count("failed optional"))
        assert (row.count, row.open) == (len(rest), rest.count("started"))

    everybody = shown(playing.picture, "measures/")
    assert everybody["mtbce"][-1][1] == pytest.approx(oracle.time_between(), abs=1e-6)
    delays = [
        (oracle.time(each["at"]), each["delay"], each["kind"])
        for each in oracle.of("connection_event")
        if each["state"] == "succeeded" and not each.get("retold") and each.get("delay") is not None
    ]
    assert [tuple(each) for each in shown(playing.picture, "delays")] == delays
