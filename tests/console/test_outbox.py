"""What waits for a program: in order, of the types it asked for, and never more than so many."""

import json

from hypothesis import given
from hypothesis import strategies as st

from engage_hri.schemas.perception import ActionBegan, ActorFound
from engage_hri.schemas.units import Stamp
from engage_hri.services.web import outbox
from engage_hri.services.web.outbox import Outbox

STEPS = st.lists(st.one_of(st.tuples(st.sampled_from(["action_began", "actor_found"])), st.just(())), max_size=60)


def message(type: str, number: int) -> ActionBegan | ActorFound:
    at = Stamp("mine", float(number))
    if type == "actor_found":
        return ActorFound(actor="ann", at=at)
    return ActionBegan(actor="ann", action="nod", at=at)


@given(steps=STEPS, only=st.sampled_from([(), ("action_began",)]), most=st.integers(1, 8))
def test_a_program_gets_the_newest_of_its_types_in_order_and_the_number_of_the_others(
    steps: list[tuple[str, ...]], only: tuple[str, ...], most: int
) -> None:
    before, outbox.MESSAGES_KEPT = outbox.MESSAGES_KEPT, most
    try:
        box, expected = Outbox(only), list[int]()
        for number, step in enumerate(steps):
            if step:
                assert box.put(message(step[0], number)) == (not only or step[0] in only)
                expected += [number] if not only or step[0] in only else []
                continue
            got = [json.loads(text) for text in box.take()]
            lost = len(expected) - most
            if lost > 0:
                assert got.pop(0) == {"type": "dropped", "count": lost}
            assert [each["at"][1] for each in got] == expected[-most:]
            expected = []
    finally:
        outbox.MESSAGES_KEPT = before


def test_the_types_are_those_of_the_protocol() -> None:
    assert {"connection_event", "utterance", "robot_state", "sync_point_reached"} <= outbox.message_types()
