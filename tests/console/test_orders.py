"""Orders of a page: what is read, who may give which, what the log says, and where a piece comes to lie."""

import math
from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.access import ROLES
from engage_hri.schemas.behaviors import Reference, Speech
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.documents import json_codec
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.tables import edges, overlap, touches
from engage_hri.schemas.tool import Say
from engage_hri.schemas.world import Entity, World
from engage_hri.services.console.web.orders import (
    RIGHTS,
    AnyOrder,
    ConditionOrder,
    InhibitGaze,
    LookOrder,
    Script,
    SteerOrder,
    SwitchOrder,
    Tell,
    backchannel,
    decoded,
    denied,
    told,
    written,
)
from engage_hri.services.console.web.scene import NEAR, laid
from engage_hri.services.tangram.table import tangram_table


@pytest.mark.parametrize(
    ("text", "order"),
    [
        ('{"do": "look"}', LookOrder()),
        ('{"do": "look", "target": "cup"}', LookOrder(target="cup")),
        ('{"do": "steer", "to": "stop", "by": "ann"}', SteerOrder(to="stop", by="ann")),
        ('{"do": "faults", "fault": {"kind": "slow"}}', SwitchOrder(fault=BodyFault(kind="slow"))),
        ('{"do": "condition", "name": "b", "speech_only": true}', ConditionOrder(name="b", speech_only=True)),
    ],
)
def test_an_order_is_read(text: str, order: AnyOrder) -> None:
    assert decoded(text) == order


@pytest.mark.parametrize(
    "text",
    ["", "{}", '{"do": "fly"}', '{"do": "move", "thing": "a", "x": 1e9, "y": 0}', '{"do": "type", "text": ""}',
     "[" * 9999, '{"do": "speak"}',
     '{"do": "prepared", "number": -1}', '{"do": "tell", "text": "' + "a" * 5000 + '"}'],
)  # fmt: skip
def test_what_is_no_order_is_refused_with_a_reason(text: str) -> None:
    with pytest.raises(InputRefused) as error:
        decoded(text)

    assert error.value.fault.reason


@settings(max_examples=50)
@given(st.binary(max_size=60))
def test_no_bytes_break_the_reading(text: bytes) -> None:
    with suppress(InputRefused):
        assert decoded(text) is not None


@pytest.mark.parametrize("role", ROLES)
def test_what_a_role_may_not_is_denied_with_the_roles_that_may(role: str) -> None:
    reasons = denied(role, trusted=True)

    assert {"seat", "speak", "steer", "faults", "condition"} - reasons.keys() == set(RIGHTS.get(role, ()))
    for right, reason in reasons.items():
        assert role in reason
        assert all(name in reason for name, rights in RIGHTS.items() if right in rights)


def test_an_address_without_the_token_lets_nobody_take_part() -> None:
    assert set(denied("wizard", trusted=False)) == {"seat", "speak", "steer", "faults", "condition"}
    assert all("token" in reason for reason in denied("wizard", trusted=False).values())
    assert denied("wizard", trusted=True) == {}


def test_with_keys_it_is_these_that_say_what_the_window_may() -> None:
    assert denied("observer", trusted=True, keyed=True)["steer"] == (
        "the window has keys of the role observer; start it with those of operator or wizard"
    )


def test_the_log_has_what_was_ordered_but_not_the_words() -> None:
    assert written(Tell(text="a secret", target="cup", asks=True)) == "asks 8 characters about cup"
    assert written(SwitchOrder(fault=BodyFault(kind="slow"))) == "fault on: slow"
    assert written(SwitchOrder(fault=BodyFault(kind="slow"), off=True)) == "fault off: slow"
    assert written(SteerOrder(to="hold")) == "hold"
    assert written(ConditionOrder(name="b", speech_only=True)) == "condition: b, speech only"
    assert written(ConditionOrder()) == "condition: none"
    assert written(InhibitGaze(on=True, mode="target", target="cup")) == "keeps the gaze on cup"
    assert written(InhibitGaze(on=True)) == "keeps the gaze where it is"


def test_words_and_a_reference_are_a_turn_that_engage_can_read() -> None:
    order = Tell(target="cup", asks=True, addressee=("ann", "bob"), interruptible=False)
    asked = json_codec_fragment(told(order, [Say(say="Could you hand me")]))
    said = json_codec_fragment(told(Tell(), [Say(say="Thanks.")]))

    assert [type(each) for each in asked.behaviors] == [Speech, Reference]
    assert (asked.turn_index, asked.addressee, asked.interruptible) == (1, ("ann", "bob"), False)
    assert (said.turn_index, said.addressees, said.interruptible, said.interruptible_after) == (3, (), None, None)
    assert json_codec_fragment(backchannel("uh-huh")).turn_status == "backchannel"


def json_codec_fragment(value: dict[str, object]) -> TurnFragment:
    import msgspec

    (fragment,) = json_codec.read(msgspec.json.encode(value), "page", "x")
    assert isinstance(fragment, TurnFragment)
    return fragment


def test_a_prepared_fragment_is_for_whom_it_names_or_else_for_whom_the_wizard_has_chosen() -> None:
    made = Script((TurnFragment(id="a", addressee="ann"), TurnFragment(id="b")))
    taken = [made.take(0, ("kim",)), made.take(1, ("kim", "lee")), made.take(1)]

    assert [isinstance(each, TurnFragment) and each.addressees for each in taken] == [("ann",), ("kim", "lee"), ()]
    assert backchannel("nod", ("kim",))["addressee"] == ("kim",)


def test_each_performance_of_the_script_has_an_id_of_its_own() -> None:
    hello = TurnFragment(
        id="hello", behaviors=(Speech(id="s", text="Look at"), Reference(id="r", target="cup"))
    )  # fmt: skip
    script = Script((hello, Block(id="wave")))

    assert script.titles == ("Look at [cup]", "wave")
    assert [script.take(0).id, script.take(0).id, script.take(1).id] == ["hello-1", "hello-2", "wave-3"]


# -- laying pieces ---------------------------------------------------------------------------------------------------

TABLE = tangram_table()
PIECES = {piece.id: TABLE.lying(piece, piece.start) for piece in TABLE.pieces}
SURFACE = Entity(
    id="table", kind="surface", position=TABLE.surface.center, footprint=tuple(TABLE.surface.footprint)
)  # fmt: skip
WORLD = World(entities=(SURFACE, *PIECES.values()))


def test_a_piece_that_is_dropped_near_its_neighbor_is_laid_at_its_edge() -> None:
    goal = TABLE.piece("blue-square").goal
    lies = laid(WORLD, "blue-square", goal.x + 0.012, goal.y - 0.014)

    assert lies is not None
    assert any(touches(a, b) for a in edges(lies) for b in edges(PIECES["rectangle"]))
    assert math.dist(lies.position[:2], (goal.x, goal.y)) < 0.001


def test_a_piece_in_the_open_lies_where_it_is_dropped_and_never_beside_the_table() -> None:
    assert laid(WORLD, "blue-square", 0.85, 0.35) is not None
    lies = laid(WORLD, "blue-square", 0.85, 0.35)
    beyond = laid(WORLD, "blue-square", 9.0, -9.0)

    assert lies is not None
    assert beyond is not None
    assert lies.position == (0.85, 0.35, 0.72)
    assert lies.yaw == PIECES["blue-square"].yaw
    assert beyond.position == (1.0, -0.5, 0.72)


@settings(max_examples=40, deadline=None)
@given(st.sampled_from(sorted(PIECES)), st.floats(0.25, 1.0), st.floats(-0.5, 0.5))
def test_a_piece_never_moves_far_from_where_it_is_dropped_nor_onto_another_one(id: str, x: float, y: float) -> None:
    lies = laid(WORLD, id, x, y)

    assert lies is not None
    far = math.dist(lies.position[:2], (x, y))
    assert far < NEAR
    assert far == 0 or not any(overlap(lies, other) for name, other in PIECES.items() if name != id)


def test_what_is_no_object_cannot_be_moved() -> None:
    assert laid(WORLD, "table", 0.5, 0.0) is None
    assert laid(WORLD, "nothing", 0.5, 0.0) is None
