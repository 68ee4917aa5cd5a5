"""The request protocol as a model: both machines, two clients, restarts, and a network that does its worst."""

import random
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Block, BlockOutcome, PerformBlock
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.requests import Accepted, Heard, KeepAlive, Kept, Outdated, Refused
from engage_hri.schemas.units import Stamp
from engage_hri.services.requests import asking_table, serving_table
from engage_hri.services.requests.asking import Asking, Patience
from engage_hri.services.requests.serving import Serving
from tests.requests.request_world import World

ROOT = Path(__file__).parents[2]
RUNS = 400


MACHINES = [
    (asking_table.TABLE, asking_table.AskingState, asking_table.AskingEvent, asking_table.AskingAction),
    (serving_table.TABLE, serving_table.ServingState, serving_table.ServingEvent, serving_table.ServingAction),
]


@pytest.mark.parametrize(("table", "states", "happenings", "possible"), MACHINES, ids=["asking", "serving"])
def test_every_state_has_a_row_for_every_event(table: Any, states: Any, happenings: Any, possible: Any) -> None:
    for state, event in product(states, happenings):
        after, actions = table[state][event]
        assert after in states
        assert all(action in possible for action in actions)


@pytest.mark.parametrize(("table", "states", "happenings", "possible"), MACHINES, ids=["asking", "serving"])
def test_every_state_can_be_reached_and_every_action_is_used(
    table: Any, states: Any, happenings: Any, possible: Any
) -> None:
    rows = [row for events in table.values() for row in events.values()]

    assert {event for events in table.values() for event in events} == set(happenings)
    assert {after for after, _ in rows} == set(states)
    assert {action for _, actions in rows for action in actions} == set(possible)


def test_a_requester_can_leave_every_state_without_its_server() -> None:
    """Whatever the server does or fails to do, the clock alone leads to the end."""
    clock = [
        asking_table.AskingEvent.GRACE_OVER, asking_table.AskingEvent.PATIENCE_OVER,
        asking_table.AskingEvent.SWALLOW_OVER,
    ]  # fmt: skip
    for state in asking_table.AskingState:
        reached, todo = {state}, [state]
        while todo:
            here = todo.pop()
            for event in (*clock, asking_table.AskingEvent.CANCELLED):
                after, _ = asking_table.TABLE[here][event]
                if after not in reached:
                    reached.add(after)
                    todo.append(after)
        assert asking_table.AskingState.ENDED in reached


@pytest.mark.parametrize("part", range(8))
def test_each_request_ends_exactly_once_and_nothing_is_pending_for_ever(part: int) -> None:
    for seed in range(part * RUNS // 8, (part + 1) * RUNS // 8):
        world = World(seed)
        try:
            world.play(random.Random(seed).randrange(5, 60))
            world.judge()
        except Exception as error:
            error.add_note(f"seed {seed}")
            raise


def test_where_nobody_dies_callers_are_told_what_was_done_and_services_have_what_was_asked_last() -> None:
    for seed in range(150):
        world = World(seed, is_fair=True)
        try:
            world.play(30)
            world.judge()
            world.judge_fair()
        except Exception as error:
            error.add_note(f"seed {seed}")
            raise


def test_any_sequence_of_anything_raises_nothing_at_a_requester() -> None:
    answers: list[Any] = [
        Heard(id=""), Accepted(id=""), Outdated(id=""), Refused(id="", fault=Fault(reason="no")),
        BlockOutcome(id="", block="b", status="done"),
    ]  # fmt: skip
    chance = random.Random(1)
    for _ in range(300):
        asking = Asking("me", "life", Patience())
        now = 0.0
        for _ in range(60):
            id = chance.choice("ab")
            match chance.randrange(6):
                case 0:
                    asking.send(keys.BLOCK, PerformBlock(id=id, block=Block(id=chance.choice("xy"))), now)
                case 1:
                    asking.cancel(id, Fault(reason="no"), now)
                case 2:
                    asking.server_gone("realizer", now)
                case 3:
                    asking.server_there("realizer", chance.choice(["", "1", "2"]), now)
                case 4:
                    now += chance.choice([0.0, 0.3, 3.0, 100.0])
                    asking.tick(now)
                case 5:
                    whose = {"requester": chance.choice(["me", "you"]), "life": chance.choice(["life", "other"])}
                    kind = chance.choice(["perform_block", "inhibit", ""])
                    answer = chance.choice(answers)
                    fields = {name: getattr(answer, name) for name in answer.__struct_fields__}
                    asking.hear(type(answer)(**{**fields, "id": id, "kind": kind, **whose}), now, "realizer")


def test_a_lease_that_a_late_message_renews_is_not_shortened() -> None:
    serving = Serving("realizer")
    serving.take(PerformBlock(id="a", requester="me", life="1", lease=5.0, block=Block(id="b")), 10.0)
    late = KeepAlive(live=(Kept("perform_block", "a", 0, "", 5.0),), at=Stamp("w", 0.0), requester="me", life="1")

    serving.keep_alive(late, 2.0, 11.0)

    assert serving.deadline == 15.0


@pytest.mark.parametrize("table", [asking_table, serving_table])
def test_the_page_draws_the_tables(table: Any) -> None:
    lines = ["stateDiagram-v2"]
    for state, rows in table.TABLE.items():
        ways: dict[Any, list[str]] = {}
        for event, (after, _) in rows.items():
            if after is not state:
                ways.setdefault(after, []).append(event.name.lower())
        lines += [f"    {state.name} --> {after.name}: {', '.join(events)}" for after, events in ways.items()]

    assert "```mermaid\n" + "\n".join(lines) + "\n```" in (ROOT / "docs" / "bus.md").read_text()
