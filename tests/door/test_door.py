"""The door: who may do what at it, what is too large or too much, and that each call is what the client does."""

import asyncio
import json

import jsonschema
import msgspec
import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActionBegan
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import Robot
from engage_hri.services.door import server
from engage_hri.services.door.openapi import document
from engage_hri.services.door.operations import OPERATIONS, TOPICS
from engage_hri.services.door.server import DoorServer
from engage_hri.services.web import outbox
from tests.door.callers import TOKENS, Programs, at_a_door

TURN = {"turn_status": "full", "parts": [{"say": "Please take"}, {"refer": "blue-square"}]}
LONG = {"turn_status": "full", "parts": [{"say": "one two three four five six seven eight nine ten eleven twelve"}]}
DRIVES, STEERS, ALL = {"manager", "wizard"}, {"operator", "wizard"}, {*TOKENS}
MAY = {
    "POST /v1/turn": DRIVES, "POST /v1/fragment": DRIVES, "POST /v1/block": DRIVES | {"operator"},
    "POST /v1/interrupt": DRIVES | {"operator"}, "POST /v1/inhibit": DRIVES,
    "POST /v1/block/hold": DRIVES | {"operator"}, "POST /v1/block/resume": DRIVES | {"operator"},
    "POST /v1/block/stop": DRIVES | {"operator"}, "POST /v1/robot/hold": STEERS, "POST /v1/robot/resume": STEERS,
    "POST /v1/robot/stop": STEERS, "PUT /v1/condition": STEERS, "PUT /v1/faults": STEERS, "GET /v1/world": ALL,
    "GET /v1/person": ALL, "GET /v1/floor": ALL, "GET /v1/statistics": ALL, "GET /v1/head": ALL,
    "GET /v1/capabilities": ALL, "GET /v1/condition": ALL, "GET /v1/faults": ALL,
}  # fmt: skip
"""Roles by docs/security.md. An operator has the key of blocks, for holding one."""


async def test_each_role_may_what_it_may_on_the_bus_and_a_stranger_nothing() -> None:
    assert {*MAY} == {f"{each.method} {each.path}" for each in OPERATIONS}

    async with MemoryHub() as hub, Robot.on(hub.join("door")) as robot:
        programs = Programs(DoorServer(robot, robot._bus, TOKENS))
        for asked, able in MAY.items():
            method, path = asked.split()
            for role in (*TOKENS, "", "token-of-nobody"):
                code, said = await programs.ask(method, f"{path}?timeout=0.1", {}, role=role)
                expected = {400, 502, 504} if role in able else {403} if role in TOKENS else {401}
                assert code in expected, (asked, role, code, said)


async def test_a_door_has_no_more_rights_than_its_own_keys() -> None:
    async with MemoryHub() as hub, Robot.on(hub.join("door", "manager")) as robot:
        programs = Programs(DoorServer(robot, robot._bus, TOKENS))
        code, said = await programs.ask("POST", "/v1/robot/stop?timeout=0.1", role="wizard")

    assert (code, said["fault"]["reason"]) == (403, "the door has the role manager on the bus, which may not do that")


@pytest.mark.parametrize("length", [True, False])
@pytest.mark.parametrize(
    ("path", "most", "start"),
    [("/v1/turn", 2**20, b""), ("/v1/interrupt", 2**20, b""), ("/v1/inhibit", 2**16, b""),
     ("/v1/fragment", 2**16, b"\n <ebml"), ("/v1/robot/stop", 2**16, b"")],
)  # fmt: skip
async def test_what_is_larger_than_its_key_allows_is_refused_before_it_is_read(
    path: str, most: int, start: bytes, length: bool
) -> None:
    async with MemoryHub() as hub, Robot.on(hub.join("door")) as robot:
        programs = Programs(DoorServer(robot, robot._bus, TOKENS))
        chunks = [start, b" " * (most - len(start))]
        fits, _ = await programs.ask("POST", f"{path}?timeout=0.1", chunks=chunks, length=length, role="wizard")
        code, said = await programs.ask("POST", path, chunks=[*chunks, b" "], length=length, role="wizard")

    assert fits in (400, 502)
    assert (code, said["fault"]["reason"]) == (413, f"{most + 1} bytes; at most {most} are taken")


async def test_more_requests_at_once_than_there_is_room_for_are_refused_and_room_comes_back() -> None:
    async with MemoryHub() as hub, Robot.on(hub.join("door")) as robot:
        programs = Programs(DoorServer(robot, robot._bus, TOKENS))
        asked = [programs.ask("GET", "/v1/world?timeout=5") for _ in range(server.MOST_AT_ONCE)]
        waiting = [asyncio.create_task(each) for each in asked]
        await asyncio.sleep(1.0)
        code, said = await programs.ask("GET", "/v1/world")
        ended = [(await each).code for each in waiting]
        after, _ = await programs.ask("GET", "/v1/world")

    assert (code, said["fault"]["reason"]) == (429, "64 requests are being answered")
    assert {*ended} == {504}
    assert after == 504


async def test_a_turn_is_performed_and_told_as_to_a_model() -> None:
    async with at_a_door() as here:
        code, said = await here.programs.ask("POST", "/v1/turn?await_answer=1", TURN)

    assert (code, said["status"], said["said"]) == (200, "done", "Please take the blue square")
    assert said["references"][0]["object"] == "blue-square"
    assert said["answer"] != "pending"


async def test_what_is_wrong_in_a_turn_is_told_with_its_place_and_what_fails_with_what_was_done() -> None:
    async with at_a_door() as here:
        code, said = await here.programs.ask("POST", "/v1/turn", {"turn_status": "full", "parts": [{"sing": "la"}]})
        asked, unknown = await here.programs.ask("POST", "/v1/turn?timeot=1", TURN)
        block = {"type": "block", "id": "b", "behaviors": [{"type": "gaze", "id": "g", "target": "nobody"}]}
        failed, why = await here.programs.ask("POST", "/v1/block", block)

    assert (code, said["fault"]["where"]) == (400, "$.parts[0]")
    assert asked == 400
    assert "timeot" in unknown["fault"]["reason"]
    assert (failed, why["outcome"]["status"], why["outcome"]["dropped"]) == (502, "failed", ["g"])


async def test_a_request_whose_connection_ends_stops_the_robot() -> None:
    async with at_a_door() as here:
        gone = asyncio.Event()
        with here.robot.turns() as turns:
            asking = asyncio.create_task(here.programs.ask("POST", "/v1/turn", LONG, gone=gone))
            await asyncio.sleep(2.0)
            gone.set()
            await asking
            closed = await turns.next(2.0)

    assert closed is not None
    assert closed.status == "aborted"
    assert not closed.spoken[0].complete


async def test_a_turn_is_written_bit_by_bit_and_its_words_come_as_they_are_said() -> None:
    async with at_a_door() as here, here.programs.link("/v1/speak") as link:
        with here.robot.words() as words:
            for piece in ("Hello th", "ere. Please ta", "ke ["):
                link.say(do="text", text=piece)
            link.say(do="text", text="blue-square]")
            link.say(do="part", part={"say": "and put it down."})
            link.say(do="end")
            told = await link.until("over")
            heard = [word.word for word in [await words.next() for _ in told[1:-1]] if word is not None]

    assert [each["type"] for each in told] == ["started", *["word"] * 11, "over"]
    assert [each["word"] for each in told[1:-1]] == heard
    assert told[-1]["summary"]["said"] == "Hello there. Please take the blue square and put it down."
    assert told[-2]["said"] == told[-1]["summary"]["said"]


async def test_a_turn_is_held_goes_on_and_is_stopped_at_a_word() -> None:
    async with at_a_door() as here, here.programs.link("/v1/speak") as link:
        link.say(do="begin", turn={"addressee": "human"})
        link.say(do="text", text="one two three four five six seven eight nine ten. ")
        await link.until("word")
        link.say(do="hold")
        before = await link.until("held")
        await asyncio.sleep(3.0)
        during = [link.got.get_nowait() for _ in range(link.got.qsize())]
        link.say(do="resume")
        after = await link.until("word")
        link.say(do="stop")
        told = (await link.until("over"))[-1]["summary"]
        link.say(do="text", text="Sorry. ")
        link.say(do="end")
        next = (await link.until("over"))[-1]["summary"]

    assert len(before) <= 2
    assert [each["type"] for each in during] in ([], ["word"])
    assert "resumed" in [each["type"] for each in after]
    assert told["cut_short"]
    assert "one two three" in told["said"]
    assert "seven" not in told["said"]
    assert (next["status"], next["said"]) == ("done", "Sorry.")


async def test_a_person_who_takes_the_floor_ends_it_and_the_program_learns_how_far_it_got() -> None:
    async with at_a_door() as here, here.programs.link("/v1/speak") as link:
        link.say(do="text", text="one two three four five six seven eight nine ten eleven twelve. And so on.")
        await link.until("word")
        person = here.hub.join("perception-too")
        person.publish(keys.PERCEIVED_ACTION, ActionBegan(actor="human", action="speak", at=person.stamp()))
        told = (await link.until("over"))[-1]["summary"]
        await person.leave()

    assert (told["status"], told["cut_short"]) == ("interrupted", True)
    assert told["said"].startswith("one two")
    assert "took the floor" in told["problems"][0]


async def test_a_link_that_breaks_stops_its_turn() -> None:
    async with at_a_door() as here:
        with here.robot.turns() as turns:
            async with here.programs.link("/v1/speak") as link:
                link.say(do="text", text="one two three four five six seven eight nine ten. And so on.")
                await link.until("word")
            closed = await turns.next(2.0)

    assert closed is not None
    assert (closed.status, closed.spoken[0].complete) == ("aborted", False)


async def test_orders_that_cannot_be_carried_out_are_told_and_end_nothing() -> None:
    async with at_a_door() as here, here.programs.link("/v1/speak") as link:
        reasons = []
        for order in ({"do": "stop"}, {"do": "sing"}, {"do": "begin", "turn": {"loud": True}},
                      {"do": "part", "part": {"sing": "la"}}, {"do": "hold"}):  # fmt: skip
            link.say(**order)
            reasons.append((await link.until("fault"))[-1]["reason"])
        link.say(do="text", text="x" * 70000)
        reasons.append((await link.until("fault"))[-1]["reason"])
        link.say(do="text", text="Hello.")
        link.say(do="begin")
        reasons.append((await link.until("fault"))[-1]["reason"])
        link.say(do="end")
        told = (await link.until("over"))[-1]["summary"]

    assert reasons[0] == reasons[4] == "no turn has begun"
    assert "sing" in reasons[1]
    assert "loud" in reasons[2]
    assert "sing" in reasons[3]
    assert reasons[5] == "the turn becomes longer than 65536 characters"
    assert reasons[6] == "the turn before is not over"
    assert told["said"] == "Hello."


async def test_news_are_of_the_topics_that_were_asked_for() -> None:
    async with at_a_door() as here, here.programs.link("/v1/news?only=words,turns", role="observer") as link:
        await asyncio.sleep(1.0)
        await here.programs.ask("POST", "/v1/turn", TURN)
        told = await link.until("turn_closed")

    assert [each["word"] for each in told[:-1]] == ["Please", "take", "the", "blue", "square"]


async def test_all_topics_are_told_at_once_if_none_is_named() -> None:
    async with at_a_door() as here, here.programs.link("/v1/news", role="observer") as link:
        await here.programs.ask("POST", "/v1/turn?await_answer=1", TURN)
        await asyncio.sleep(1.0)
        told = {link.got.get_nowait()["type"] for _ in range(link.got.qsize())}

    assert told >= {
        "connection_event", "word_spoken", "turn_closed", "floor", "statistics", "action_began", "head_owner", "held",
        "study_condition", "block_progress", "sync_point_progress", "world",
    }  # fmt: skip


async def test_news_come_as_lines_too_and_an_empty_one_when_there_are_none() -> None:
    async with at_a_door() as here:
        gone = asyncio.Event()
        hearing = asyncio.create_task(here.programs.ask("GET", "/v1/news?only=words", gone=gone))
        await asyncio.sleep(1.0)
        await here.programs.ask("POST", "/v1/turn", TURN)
        await asyncio.sleep(25.0)
        gone.set()
        code, said = await hearing

    lines = said.splitlines()
    assert code == 200
    assert [json.loads(each)["word"] for each in lines if each] == ["Please", "take", "the", "blue", "square"]
    assert lines.count("") == 2


@pytest.mark.parametrize(
    ("address", "role", "closed"),
    [("/v1/news", "", 4401), ("/v1/news", "nobody", 4401), ("/v1/speak", "", 4401), ("/v1/speak", "observer", 4403),
     ("/v1/speak", "operator", 4403), ("/v1/news?only=words,gossip", "observer", 4400),
     ("/v1/news?onyl=words", "observer", 4400)],
)  # fmt: skip
async def test_a_link_to_which_there_is_no_right_is_closed_and_told_why(address: str, role: str, closed: int) -> None:
    async with MemoryHub() as hub, Robot.on(hub.join("door")) as robot:
        programs = Programs(DoorServer(robot, robot._bus, TOKENS))
        async with programs.link(address, role=role) as link:
            assert await link.got.get() is None

    assert link.closed is not None
    assert link.closed[0] == closed
    assert link.closed[1]


async def test_a_program_that_does_not_read_loses_the_oldest_news_and_is_told_how_many(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(outbox, "MESSAGES_KEPT", 5)

    async with at_a_door() as here, here.programs.link("/v1/news?only=words") as link:
        link.reads.clear()
        for _ in range(2):
            await here.programs.ask("POST", "/v1/turn", LONG)
        link.reads.set()
        told = await link.until("dropped")

    assert told[-1]["count"] >= 24 - 5 - 1
    assert len(told) <= 2


async def test_answers_are_as_the_document_says_and_it_has_all_operations() -> None:
    described = json.loads(msgspec.json.encode(document()))
    async with at_a_door() as here:
        code, said = await here.programs.ask("GET", "/v1/openapi.json", role="observer")
        answers = {("/v1/turn", "post"): await here.programs.ask("POST", "/v1/turn", TURN)}
        for each in OPERATIONS:
            if each.method == "GET":
                answers[each.path, "get"] = await here.programs.ask("GET", each.path)
        answers["/v1/inhibit", "post"] = await here.programs.ask("POST", "/v1/inhibit", {"seconds": 1.0})
        answers["/v1/condition", "put"] = await here.programs.ask(
            "PUT", "/v1/condition", {"name": "c"}, role="operator"
        )
        answers["/v1/robot/stop", "post"] = await here.programs.ask("POST", "/v1/robot/stop", role="operator")

    assert (code, said) == (200, described)
    only = described["paths"]["/v1/news"]["get"]["parameters"][0]["schema"]["description"]
    assert ", ".join(TOPICS) in only
    for (path, method), (answered, content) in answers.items():
        assert answered == 200, (path, content)
        schema = described["paths"][path][method]["responses"]["200"]["content"]["application/json"]["schema"]
        jsonschema.validate(content, {**schema, "components": described["components"]})
    assert {f"{method.upper()} {path}" for path, each in described["paths"].items() for method in each} == {
        *MAY, "GET /v1/news"
    }  # fmt: skip
