"""Words of people, and the time that an answer may take, in what the commands print."""

import json
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from engage_hri.schemas.check import problems
from engage_hri.schemas.documents.json_codec import read
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.recognition import ConnectionEvent, Floor, FloorSpeech
from engage_hri.schemas.units import Stamp
from engage_hri.services.console.terminal.log import Telling, line
from engage_hri.services.console.view import empty, feed
from tests.cli.command import Engage

ASK = """\
<ebml:ebml xmlns:ebml="edu.wpi.ebml" xmlns="org.mindmakers.bml" id="ask" turnIndex="1" turnStatus="full" {more}>
  <speech id="s"><text>Do you see the blue piece?</text></speech>
</ebml:ebml>
"""


@pytest.fixture
def ask(tmp_path: Path) -> Path:
    file = tmp_path / "ask.xml"
    file.write_text(ASK.format(more='within="4.5"'))
    return file


def test_play_tells_who_answered_and_what_they_said(engage: Engage, ask: Path) -> None:
    result = engage("play", ask, "--embedded", "--virtual-time")

    assert result.code == 0
    assert '  human: "Yes."\n' in result.out
    last = result.out.splitlines()[-1]
    assert last.endswith('Answered by human: speak, after 0.4 s. Heard from human: "Yes."')


def test_the_outcome_for_a_language_model_has_them_too(engage: Engage, ask: Path) -> None:
    told = json.loads(engage("play", ask, "--embedded", "--virtual-time", "--outcomes", "-").out)

    assert (told["answer"], told["answered_by"]) == ("speak", "human")
    assert told["heard"] == [{"who": "human", "text": "Yes."}]


def test_the_time_for_the_answer_shows_before_anything_moves(engage: Engage, ask: Path) -> None:
    assert "ask: no references; an answer within 4.5 s" in engage("plan", "--why", ask).out
    assert "may be answered for 4.5 s: turn-pair" in engage("plan", ask).out
    assert 'limit="4.5"' in engage("bml", ask).out


@pytest.mark.parametrize("value", ["0", "-1", "120.5", "inf", "nan"])
def test_a_time_that_cannot_be_is_refused_with_its_line(engage: Engage, tmp_path: Path, value: str) -> None:
    file = tmp_path / "ask.xml"
    file.write_text("\n" + ASK.format(more=f'within="{value}"'))
    result = engage("plan", file)

    assert result.code == 2
    assert f"ask.xml:2: ask: within is {float(value):g} (seconds, more than 0 and at most 120)" in result.err


def test_a_time_that_is_no_number_is_refused(engage: Engage, tmp_path: Path) -> None:
    file = tmp_path / "ask.xml"
    file.write_text(ASK.format(more='within="soon"'))

    assert "within" in engage("plan", file).err


def test_in_json_the_path_says_where() -> None:
    (found,) = problems(TurnFragment(id="ask", within=0.0))
    assert (found.path, found.reason) == ("$.within", "within is 0")
    (fragment,) = read(b'{"type": "fragment", "id": "ask", "within": 3}', "", "")
    assert isinstance(fragment, TurnFragment)
    assert fragment.within == 3


@pytest.mark.parametrize("more", [{"turn_index": 2}, {"turn_status": "middle"}, {"turn_status": "backchannel"}])
def test_time_for_an_answer_that_nobody_waits_for_is_warned_of(more: dict[str, Any]) -> None:
    from engage_hri.services.generation.turns.plan import in_vain, plan_turn

    def told(fragment: TurnFragment) -> list[str]:
        return [text.partition(":")[0] for text in in_vain(fragment, plan_turn(fragment, fragment.id, "ann"))]

    assert told(TurnFragment(id="ask", within=3.0, **more)) == ["within"]
    assert not told(TurnFragment(id="ask", within=3.0))


def test_the_log_tells_words_when_they_are_understood_and_events_once() -> None:
    scene, at = empty("robot", 0.0), Stamp("loop", 3.0)
    said = Utterance(actor="ann", id="1", text="hello", began=Stamp("loop", 2.0), at=at)
    event = ConnectionEvent(
        id="ap-1", kind="adjacency_pair", initiator="ann", responder="robot", state="started", at=at, started=at
    )
    again = replace(event, words="hello", retold=True)

    lines = [
        line(each, scene, feed(scene, each, 3.0), 3.0, Telling())
        for each in (replace(said, text="he", final=False), said, event, again)
    ]
    assert [text and text.split("  ")[-1] for text in lines] == [
        None, 'ann: "hello"', "* adjacency pair, ann → robot (human): waiting", None,
    ]  # fmt: skip


def test_the_log_tells_to_whom_others_than_the_robot_something_was_said() -> None:
    began, later = Stamp("loop", 2.0), Stamp("loop", 4.0)
    floors = {
        to: Floor(at=later, ended=(FloorSpeech(actor="ann", since=Stamp("loop", 2.1), to=to, until=later),))
        for to in ((), ("robot",), ("bob",), ("bob", "robot"))
    }
    said = Utterance(actor="ann", id="1", text="hello", began=began, at=later)

    for to, floor in floors.items():
        scene = feed(empty("robot", 0.0), floor, 4.0)
        whom = {("bob",): " (to bob)", ("bob", "robot"): " (to bob and the robot)"}.get(to, "")
        assert line(said, scene, feed(scene, said, 4.0), 4.0, Telling()) == f'  0:04.0  ann{whom}: "hello"'
    another = replace(said, began=Stamp("loop", 3.5))
    assert line(another, scene, scene, 4.0, Telling()) == '  0:04.0  ann: "hello"'
    told = replace(another, to=("bob",))
    assert line(told, scene, scene, 4.0, Telling()) == '  0:04.0  ann (to bob): "hello"'


def test_the_view_puts_words_where_they_were_said() -> None:
    from engage_hri.schemas.perception import ActionBegan, ActionEnded

    scene = empty("robot", 0.0)
    for seconds, message in (
        (2.0, ActionBegan(actor="ann", action="speak", at=Stamp("loop", 2.0))),
        (3.0, ActionEnded(actor="ann", action="speak", at=Stamp("loop", 3.0))),
        (3.5, Utterance(actor="ann", id="1", text="hello", began=Stamp("loop", 2.1), at=Stamp("loop", 3.5))),
        (4.0, Utterance(actor="ann", id="1", text="hallo", began=Stamp("loop", 2.1), at=Stamp("loop", 4.0))),
        (9.0, Utterance(actor="bob", id="1", text="typed", began=Stamp("loop", 9.0), at=Stamp("loop", 9.0))),
    ):
        scene = feed(scene, message, seconds)

    assert [(each.actor, each.began, each.text, each.open) for each in scene.said] == [
        ("ann", 2.0, "hallo", False), ("bob", 9.0, "typed", False),
    ]  # fmt: skip
