"""`engage demo`: the whole system in one process."""

import json
import re
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from engage_hri.services.commandline.look.demo import FOR_YOU, Options
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.control.voice import player
from engage_hri.services.control.voice.espeak import EspeakSettings
from tests.cli.command import Engage

VIRTUAL = ("demo", "--virtual-time")


def decided(path: Path) -> dict[str, dict[str, Any]]:
    """The decision about each connection event."""
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    return {line["id"]: line for line in lines if line["state"] != "completed"}


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """One run, in a process of its own, for the tests that only read what it wrote."""
    import subprocess
    import sys

    folder = tmp_path_factory.mktemp("demo")
    done = subprocess.run(
        [sys.executable, "-m", "engage_hri", *VIRTUAL, "--seed", "1",
         "--events", folder / "events.jsonl", "--feedback", folder / "feedback.jsonl"],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    return {"code": done.returncode, "out": done.stdout, "err": done.stderr, "folder": folder}


def test_it_ends_by_itself_and_says_how_it_went(played: dict[str, Any]) -> None:
    assert (played["code"], played["err"]) == (0, "")
    tail = played["out"][-1200:]
    for expected in ("directed gaze", "mutual facial gaze", "adjacency pair", "MTBCE", "duration", "fragments"):
        assert expected in tail


def test_the_log_tells_both_sides(played: dict[str, Any]) -> None:
    for expected in (
        'robot: "Hello, let\'s make a tangram."', "robot points at trapezoid", "human looks at",
        "human moves blue-square", "directed gaze, robot → human about trapezoid (reference)", "human has left",
    ):  # fmt: skip
        assert expected in played["out"]


def test_the_log_leaves_out_sync_points_and_who_has_the_head(played: dict[str, Any]) -> None:
    told = [line.strip().partition("  ")[2] for line in played["out"].splitlines()]

    assert sum(line.startswith("robot ") for line in told) > 10
    assert not [line for line in told if line.startswith("head: ") or re.match(r"\S+:\S+:\S+ at ", line)]


def test_each_event_ends_once_and_has_its_cause(played: dict[str, Any]) -> None:
    lines = [json.loads(line) for line in (played["folder"] / "events.jsonl").read_text().splitlines()]

    told = [line for line in lines if not line["retold"]]
    ends = Counter(line["id"] for line in told if line["state"] not in ("started", "completed"))
    assert set(ends) == {line["id"] for line in lines}
    assert set(ends.values()) == {1}
    assert {line["cause"] for line in lines} >= {"turn", "reference", "human"}


def test_each_block_starts_and_ends_once(played: dict[str, Any]) -> None:
    lines = [json.loads(line) for line in (played["folder"] / "feedback.jsonl").read_text().splitlines()]

    blocks = Counter((line["block"], line["progress"]) for line in lines if line["type"] == "block_progress")
    assert blocks
    assert set(blocks.values()) == {1}
    assert {"step-2", "step-25"} <= {block for block, _ in blocks}


def test_the_same_seed_gives_the_same_session(engage: Engage, played: dict[str, Any], tmp_path: Path) -> None:
    events, feedback = tmp_path / "events.jsonl", tmp_path / "feedback.jsonl"

    # What is the default is said here, and changes nothing.
    human, resolution = ("--human", "appendix-b"), ("--resolution", "table")
    result = engage(*VIRTUAL, "--seed", 1, *human, *resolution, "--events", events, "--feedback", feedback)

    assert result.out == played["out"]
    assert events.read_bytes() == (played["folder"] / "events.jsonl").read_bytes()
    assert feedback.read_bytes() == (played["folder"] / "feedback.jsonl").read_bytes()


def test_another_seed_gives_other_times_but_the_same_story_and_quiet_prints_nothing(
    engage: Engage, played: dict[str, Any], tmp_path: Path
) -> None:
    events = tmp_path / "events.jsonl"

    assert engage(*VIRTUAL, "--quiet", "--seed", 2, "--events", events) == (0, "", "")

    def story(path: Path) -> list[tuple[str, str, list[str]]]:
        return [
            (line["block"], line["kind"], line["objects"])
            for line in decided(path).values()
            if line["initiator"] == "robot" and line["cause"] in ("turn", "reference")
        ]

    first = played["folder"] / "events.jsonl"
    assert events.read_bytes() != first.read_bytes()
    assert story(events) == story(first)


def test_lines_on_stdout_leave_it_to_them(engage: Engage) -> None:
    result = engage(*VIRTUAL, "--events", "-")

    assert all(json.loads(line)["type"] == "connection_event" for line in result.out.splitlines())
    assert "MTBCE" in result.err


def test_the_resolution_decides_what_counts_as_shared(engage: Engage, played: dict[str, Any], tmp_path: Path) -> None:
    by_object = tmp_path / "object.jsonl"
    engage(*VIRTUAL, "--quiet", "--seed", 1, "--resolution", "object", "--events", by_object)

    def shared(path: Path) -> int:
        events = [line for line in decided(path).values() if line["cause"] == "reference"]
        return Counter(line["state"] for line in events)["succeeded"]

    assert shared(by_object) < shared(played["folder"] / "events.jsonl")


def test_a_misplaced_piece_is_asked_for_again(engage: Engage, played: dict[str, Any]) -> None:
    result = engage(*VIRTUAL, "--seed", 1, "--human", "misplacing")

    fragments = [int(re.findall(r"(\d+) fragments", text)[-1]) for text in (played["out"], result.out)]
    assert result.code == 0
    assert fragments[1] > fragments[0]


def test_people_talk_with_each_other_and_the_robot_asks(engage: Engage) -> None:
    out = engage(*VIRTUAL, "--people", "3", "--seed", "2").out

    for expected in ("cy is here", 'robot: "Ann, ', 'robot: "Cy, ', "adjacency pair, robot → bob (turn): succeeded"):
        assert expected in out


def test_people_who_talk_take_the_seat_of_others(engage: Engage) -> None:
    told = engage(*VIRTUAL, "--people", "2", "--human", "listening")

    assert told.code == 2
    assert "leave it out" in told.err


def test_visitors_hear_the_voice_at_their_page_and_no_sound_card_is_needed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "pacat").write_text("#!/bin/sh\nexit 1\n")
    (tmp_path / "pacat").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert player.found(EspeakSettings()) is not None

    config = Options(kiosk=True, voice="espeak").read(Config, defaults=FOR_YOU)

    assert config.hearing.source == "page"
    assert player.found(EspeakSettings(**config.control.drivers["espeak"])) is None


@pytest.mark.parametrize("seat", ["--you", "--kiosk"])
@pytest.mark.parametrize("wrong", [("--voice", "nosuch"), ("--body", "nosuch")])
def test_what_cannot_be_is_refused_before_an_address_is_told(
    engage: Engage, seat: str, wrong: tuple[str, ...]
) -> None:
    pytest.importorskip("starlette", reason="needs the extra `console`")

    refused = engage("demo", seat, "--port", "0", *wrong)

    assert (refused.code, "'nosuch'" in refused.err, "http" in refused.out + refused.err) == (2, True, False)
