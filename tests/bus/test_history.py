"""Programs that know only Zenoh: a plain session in client mode, no line of Engage in what it does."""

import asyncio
import json
import os
from collections.abc import AsyncIterator
from typing import Any

import msgspec
import pytest
import pytest_asyncio
import zenoh

from engage_hri.schemas import keys
from engage_hri.schemas.messages import decode, encode, encode_json
from engage_hri.schemas.participants import AskStatus
from engage_hri.schemas.recognition import OpenEvents
from engage_hri.schemas.requests import Accepted
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.zenoh import readers
from engage_hri.services.bus.zenoh import session as zenoh_session
from engage_hri.services.bus.zenoh.history import BATCH, History, finish
from engage_hri.services.bus.zenoh.hub import ZenohHub, open_hub
from engage_hri.services.bus.zenoh.order import PULSE_FOR, Envelope, Missing
from engage_hri.services.runtime.service import Ready, running
from tests.bus.places import PATIENCE, acquainted, echo, free_endpoint, matched, messages, numbers, state, take
from tests.commanding import command

pytestmark = pytest.mark.real_time


class Visitor:
    """Asks as the documentation says."""

    def __init__(self, endpoint: str, robot: str) -> None:
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
        self.session: Any = zenoh.open(config)
        self.robot = robot

    async def get(self, selector: str, **options: Any) -> list[zenoh.Reply]:
        """All replies, in the order in which they came."""
        loop, ended, replies = asyncio.get_running_loop(), asyncio.Event(), []
        handler = zenoh.handlers.Callback(
            replies.append, lambda: loop.call_soon_threadsafe(ended.set), indirect=False
        )
        self.session.get(f"{self.robot}/{selector}", handler, timeout=PATIENCE / 2, **options)
        await asyncio.wait_for(ended.wait(), PATIENCE)
        return replies

    async def samples(self, selector: str, **options: Any) -> list[zenoh.Sample]:
        return [reply.ok for reply in await self.get(selector, **options) if reply.ok is not None]


Town = tuple[ZenohHub, ZenohHub, Visitor]


@pytest_asyncio.fixture
async def town() -> AsyncIterator[Town]:
    """Two processes, and a visitor at the first's door."""
    robot, end = f"visited-{os.getpid()}", free_endpoint()
    near = await open_hub(robot, listen=[end])
    far = await open_hub(robot, connect=[end])
    await acquainted(near, far)
    visitor = Visitor(end, robot)
    yield near, far, visitor
    visitor.session.close()
    await far.close()
    await near.close()


def texts(samples: list[zenoh.Sample]) -> list[str]:
    return [decode(sample.payload.to_bytes(), str(sample.encoding)).id for sample in samples]  # type: ignore[union-attr]


async def test_a_visitor_gets_the_last_state_of_every_key_of_every_process(town: Town):
    near, far, visitor = town
    here, there = near.join("here"), far.join("there")
    for number in range(3):
        here.publish(keys.WORLD, state(number))
        there.publish(keys.statistics("all"), state(10 + number))
        there.publish(keys.HEAD_OWNER, state(20 + number))
    here.publish(keys.FEEDBACK, state(99))
    await near.peers.round_trip(far.run, PATIENCE)  # by then it is known that the other answers, too

    samples = await visitor.samples("engage/v1/state/**")

    found = dict(zip([str(sample.key_expr) for sample in samples], texts(samples), strict=True))
    assert found == {
        f"{visitor.robot}/{keys.WORLD}": "2",
        f"{visitor.robot}/{keys.statistics('all')}": "12",
        f"{visitor.robot}/{keys.HEAD_OWNER}": "22",
    }


async def test_a_reply_is_what_was_published_down_to_attachment_and_timestamp(town: Town):
    _, far, visitor = town
    loop, came = asyncio.get_running_loop(), asyncio.Queue[zenoh.Sample]()
    handler = zenoh.handlers.Callback(
        lambda sample: loop.call_soon_threadsafe(came.put_nowait, sample), indirect=False
    )
    visitor.session.declare_subscriber(f"{visitor.robot}/engage/v1/evt/**", handler)
    there = far.join("there")
    await matched(far, keys.FEEDBACK)

    there.publish(keys.FEEDBACK, state(1))
    live = await asyncio.wait_for(came.get(), PATIENCE)
    [kept] = await visitor.samples(keys.FEEDBACK)

    for one in (live, kept):
        assert one.attachment is not None
        assert one.timestamp is not None
    assert kept.payload.to_bytes() == live.payload.to_bytes() == encode(state(1))
    assert str(kept.encoding) == str(live.encoding) == "application/msgpack;engage.Accepted/1"
    assert kept.attachment.to_bytes() == live.attachment.to_bytes()  # type: ignore[union-attr]
    assert kept.timestamp == live.timestamp


async def test_recent_events_and_commands_come_in_order_across_keys_unless_zenoh_is_let_merge_them(town: Town):
    near, far, visitor = town
    there = far.join("there")
    ways = [keys.FEEDBACK, keys.request_state("there"), keys.BLOCK]
    for number in range(100):
        there.publish(ways[number % 3], state(number))
    there.publish(keys.WORLD, state(100))
    await near.peers.round_trip(far.run, PATIENCE)  # the visitor's door knows now that there is a past

    everything = {"consolidation": zenoh.ConsolidationMode.NONE}
    both = await visitor.samples("engage/v1/evt/**", **everything)
    commands = await visitor.samples("engage/v1/cmd/realizer/**", **everything)
    last = await visitor.samples("engage/v1/evt/**")

    assert texts(both) == [str(number) for number in range(100) if number % 3 != 2]
    assert [sample.timestamp for sample in both] == sorted(sample.timestamp for sample in both)  # type: ignore[type-var]
    assert texts(commands) == [str(number) for number in range(2, 100, 3)]
    assert sorted(texts(last)) == ["97", "99"]


async def test_age_says_how_far_back_commands_and_events_go_and_states_have_none(town: Town):
    near, _, visitor = town
    here = near.join("here")
    here.publish(keys.FEEDBACK, state(1))
    here.publish(keys.WORLD, state(2))
    with here.subscribe(keys.INHIBIT) as never:
        assert await never.next(here.now() + keys.HISTORY_MAX_AGE + 0.1) is None
    here.publish(keys.FEEDBACK, state(3))

    everything = {"consolidation": zenoh.ConsolidationMode.NONE}
    assert texts(await visitor.samples("engage/v1/evt/**", **everything)) == ["3"]
    assert texts(await visitor.samples("engage/v1/evt/**?age=60", **everything)) == ["1", "3"]
    assert texts(await visitor.samples("engage/v1/state/**?age=0")) == ["2"]


async def test_json_comes_when_the_selector_asks_for_it(town: Town):
    near, _, visitor = town
    near.join("here").publish(keys.WORLD, state(1))

    [sample] = await visitor.samples("engage/v1/state/**?format=json")

    assert str(sample.encoding) == "application/json;engage.Accepted/1"
    assert json.loads(sample.payload.to_bytes()) == {"type": "accepted", "id": "1"}


async def test_a_question_in_json_is_answered_in_json(town: Town):
    near, far, visitor = town
    far.join("there").answer(keys.DESCRIBE, echo)
    await near.join("here").query(keys.DESCRIBE, Accepted(id="a"), PATIENCE)  # the visitor's door knows who answers
    good, bad = ({"payload": encode_json(Accepted(id=id)), "encoding": "application/json"} for id in ("a", "bad"))

    [answer] = await visitor.get(keys.DESCRIBE, **good)
    [refusal] = await visitor.get(keys.DESCRIBE, **bad)

    assert json.loads(answer.ok.payload.to_bytes()) == {"type": "accepted", "id": "a!"}  # type: ignore[union-attr]
    assert json.loads(refusal.err.payload.to_bytes())["reason"] == "bad indeed"  # type: ignore[union-attr]


@pytest.mark.parametrize("parameters", ["format=xml", "age=soon", "age=-1", "age=nan"])
async def test_a_parameter_that_makes_no_sense_is_refused_by_every_process_with_a_past(town: Town, parameters: str):
    *hubs, visitor = town
    for each in hubs:
        each.join(each.run).publish(keys.HEAD_OWNER, state(1))
    await hubs[0].peers.round_trip(hubs[1].run, PATIENCE)

    replies = await visitor.get(f"engage/v1/state/**?{parameters}")

    faults = [json.loads(reply.err.payload.to_bytes()) for reply in replies if reply.err is not None]
    assert len(faults) == len(replies) == 2
    assert all(parameters.partition("=")[2] in fault["reason"] for fault in faults)
    assert all(fault["advice"] for fault in faults)


async def test_a_long_history_is_handed_out_in_parts_so_that_the_loop_goes_on(town: Town):
    near, _, visitor = town
    here = near.join("here")
    for number in range(2000):
        here.publish(keys.FEEDBACK, state(number))
    asking = asyncio.create_task(
        visitor.samples("engage/v1/evt/**?age=600;format=json", consolidation=zenoh.ConsolidationMode.NONE)
    )
    turns = 0
    while not asking.done():
        turns += 1
        await asyncio.sleep(0)

    assert texts(await asking) == [str(number) for number in range(2000)]
    assert turns > 2000 / BATCH


async def test_without_a_payload_a_visitor_asks_every_service_how_it_is(town: Town):
    near, far, visitor = town

    async def work(bus: Bus, ready: Ready) -> None:
        ready()
        await asyncio.Event().wait()

    async with running(near, {"one": work, "two": work}), running(far, {"three": work}):
        await near.join("here").query(keys.status("three"), AskStatus(), PATIENCE)
        replies = await visitor.samples(f"{keys.status('*')}?format=json", target=zenoh.QueryTarget.ALL)

    found = {status["participant"]: status for status in (json.loads(one.payload.to_bytes()) for one in replies)}
    assert found.keys() == {"one", "two", "three"}
    assert found["one"]["run"] == found["two"]["run"] == near.run
    assert found["three"]["run"] == far.run
    assert all(status["bus"]["passed"] > 0 and status["bus"]["lag"] > 0 for status in found.values())


async def test_what_is_for_programs_of_others_comes_as_json_but_they_may_ask_otherwise(town: Town):
    near, _, visitor = town
    here = near.join("here")
    open_events = OpenEvents(actor="ann", session="life", at=here.stamp())
    here.publish(keys.open_events("ann"), open_events)

    [plain] = await visitor.samples("engage/v1/state/**")
    [asked] = await visitor.samples("engage/v1/state/**?format=msgpack")

    assert json.loads(plain.payload.to_bytes())["session"] == "life"
    assert str(asked.encoding) == "application/msgpack;engage.OpenEvents/1"
    assert decode(asked.payload.to_bytes(), str(asked.encoding)) == open_events


@pytest.mark.parametrize("names_a_source", [False, True])
async def test_a_forged_message_far_ahead_deafens_nobody(town: Town, names_a_source: bool, caplog: Any):
    """A stranger puts one message with the envelope of another, only its number and its count are far higher."""
    near, far, visitor = town
    there, inbox = far.join("there"), near.join("here").subscribe(keys.FEEDBACK)
    there.publish(keys.FEEDBACK, state(1))
    assert numbers(await messages(inbox)) == [1]
    [true] = await visitor.samples(keys.FEEDBACK)
    envelope = msgspec.msgpack.decode(true.attachment.to_bytes())  # type: ignore[union-attr]
    envelope[3] = envelope[4] = 10**9
    source = {"source_info": zenoh.SourceInfo(far.session.id, 0)} if names_a_source else {}
    key, payload, form = f"{visitor.robot}/{keys.FEEDBACK}", encode(state(-1)), "application/msgpack"

    visitor.session.put(key, payload, encoding=form, attachment=msgspec.msgpack.encode(envelope), **source)
    if not names_a_source:  # a message of a stranger, and nothing else
        assert numbers(await messages(inbox)) == [-1]
    for number in range(2, 5):
        there.publish(keys.FEEDBACK, state(number))

    assert numbers(await messages(inbox, 3)) == [2, 3, 4]
    assert near.readers.missed(near._buses["here"])[1] == 0
    if names_a_source:
        assert await inbox.next(near.join("timer").now() + 1.5) is None  # after the next pulse, too
        assert "never sent them" in caplog.text


async def test_nothing_is_believed_of_a_process_that_has_shown_no_past(town: Town, caplog: Any):
    """Nobody can answer for it: that no answer comes proves nothing. What it says later comes, and as news."""
    near, far, visitor = town
    silent, inbox = far.join("silent"), near.join("here").subscribe(keys.FEEDBACK)
    envelope = Envelope("silent", silent.clock, silent.now(), 7, 1)
    visitor.session.put(
        f"{visitor.robot}/{keys.FEEDBACK}", encode(state(-1)), encoding="application/msgpack",
        attachment=msgspec.msgpack.encode(envelope), source_info=zenoh.SourceInfo(far.session.id, 0),
    )  # fmt: skip

    assert await inbox.next(silent.now() + readers.UNANSWERED + 0.5) is None
    silent.publish(keys.FEEDBACK, state(1))
    [told] = await take(inbox)

    assert (told.message, told.past) == (state(1), False)
    assert "never sent them" in caplog.text


async def test_one_key_of_one_process_can_be_asked_for(town: Town):
    near, far, visitor = town
    near.join("here").publish(keys.FEEDBACK, state(1))
    far.join("there").publish(keys.FEEDBACK, state(2))

    async with asyncio.timeout(PATIENCE):
        while len(both := await visitor.get(keys.FEEDBACK, consolidation=zenoh.ConsolidationMode.NONE)) < 2:
            pass  # a process answers for a class of keys once it has published on it
    one = await visitor.get(f"{keys.FEEDBACK}?run={far.run}")

    assert {str(each.replier_id.zid): texts([each.ok]) for each in both} == {near.run: ["1"], far.run: ["2"]}  # type: ignore[list-item,union-attr]
    assert texts([each.ok for each in one]) == ["2"]  # type: ignore[misc]


async def test_who_may_not_publish_on_a_key_hands_out_nothing_for_it(monkeypatch: pytest.MonkeyPatch):
    """The rules know one process by its id. It keeps what it could not publish, and is asked for it."""
    robot, end, viewer = f"ruled-{os.getpid()}", free_endpoint(), "abc1"
    rule = {"id": "no commands", "permission": "deny", "flows": ["ingress"], "messages": ["put", "reply"]}
    rules = {
        "enabled": True, "default_permission": "allow",
        "rules": [rule | {"key_exprs": [f"{robot}/{keys.of_class('cmd')}"]}],
        "subjects": [{"id": "viewer", "zids": [viewer]}],
        "policies": [{"rules": ["no commands"], "subjects": ["viewer"]}],
    }  # fmt: skip
    make = zenoh_session._config

    def ruled(robot: str, connect: Any, listen: Any, mode: str, *more: Any) -> zenoh.Config:
        config = make(robot, connect, listen, mode, *more)
        here = end in listen
        config.insert_json5("access_control" if here else "id", json.dumps(rules if here else viewer))
        return config

    monkeypatch.setattr(zenoh_session, "_config", ruled)
    near, far = await open_hub(robot, listen=[end]), await open_hub(robot, connect=[end])
    await acquainted(near, far)
    there = far.join("viewer")
    assert far.run == viewer
    command(there, keys.FRAGMENT, state(1))
    there.publish(keys.FEEDBACK, state(2))

    inbox = near.join("generation").subscribe(keys.commands("generation"), keys.FEEDBACK)
    command(there, keys.FRAGMENT, state(3))
    there.publish(keys.FEEDBACK, state(4))

    assert numbers(await messages(inbox, 2)) == [2, 4]
    assert await inbox.next(near.join("timer").now() + 1.5) is None  # after the next pulse, too
    await far.close()
    await near.close()


async def test_a_process_that_never_answers_at_first_is_asked_until_it_does(monkeypatch: pytest.MonkeyPatch):
    """Nothing is lost meanwhile, though what was sent is no longer recent, and no count tells of it any more."""
    loop, answers, asked = asyncio.get_running_loop(), History._missing_asked, 0

    def slow(history: History, query: zenoh.Query) -> None:
        nonlocal asked
        asked += 1
        is_late = loop.time() > published + PULSE_FOR + 0.3
        answers(history, query) if is_late and asked > 3 else finish(query)

    monkeypatch.setattr(History, "_missing_asked", slow)
    monkeypatch.setattr(readers, "UNANSWERED", 0.5)
    robot, end = f"visited-{os.getpid()}", free_endpoint()
    near, far = await open_hub(robot, listen=[end]), await open_hub(robot, connect=[end])
    await acquainted(near, far)
    far.join("there").publish(keys.FEEDBACK, state(1))
    published = loop.time()

    assert [one.id for one in await messages(near.join("here").subscribe(keys.FEEDBACK))] == ["1"]
    assert asked > 3
    await far.close()
    await near.close()


async def test_a_past_of_many_megabytes_comes_whole_to_a_late_process(town: Town):
    """No single answer may be as large as all that is kept of a key."""
    near, far, _ = town
    there, here = near.join("there"), far.join("here")
    key = keys.request_state("there")
    for number in range(10):
        there.publish(key, Accepted(id=f"{number}{'x' * 900_000}"))

    assert [each.id[:2] for each in await messages(here.subscribe(key), 10)] == [f"{n}x" for n in range(10)]


async def test_what_is_too_large_in_json_is_refused_alone(town: Town):
    near, _, visitor = town
    bus = near.join("there")
    bus.publish(keys.WORLD, Accepted(id="\x01" * 300_000))  # a letter that JSON writes with six
    bus.publish(keys.HEAD_OWNER, state(2))

    replies = await visitor.get("engage/v1/state/**?format=json")

    [good] = [reply.ok for reply in replies if reply.ok]
    [bad] = [reply.err for reply in replies if reply.err]
    assert texts([good]) == ["2"]
    assert "bytes; at most 1048576 may be sent" in json.loads(bad.payload.to_bytes())["reason"]
    assert len(await visitor.samples("engage/v1/state/**")) == 2


async def test_a_question_with_more_counts_than_it_can_have_gets_all_that_is_kept(town: Town):
    near, far, _ = town
    there = near.join("there")
    for number in range(3):
        there.publish(keys.fault("there"), state(number))
    seen = {f"engage/v1/evt/{number}/{'x' * 1000}": 1 for number in range(1200)} | {keys.fault("there"): 2}
    told: list[list[int]] = []
    ended = asyncio.Event()

    await far.peers.round_trip(near.run, PATIENCE)  # by then it is known that the other answers

    history: History = far._history
    history.ask(
        ["engage/v1/evt/**"], near.run, Missing(seen, is_new=False),
        lambda past: told.append([one.envelope.nth for one in past.written]), lambda _: ended.set(),
    )  # fmt: skip
    await asyncio.wait_for(ended.wait(), PATIENCE)

    assert told == [[1, 2, 3]]
