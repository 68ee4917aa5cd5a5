"""To whom of several people the robot gives the turn."""

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.fragments import TurnFragment, TurnStatus
from engage_hri.schemas.perception import ActionEnded
from engage_hri.schemas.units import Stamp
from engage_hri.services.generation.turns.robot_turns import RobotTurns
from tests.generation.turns import robot_turns, seen


def spoken(turns: RobotTurns, *speeches: tuple[float, str]) -> None:
    """These have ended a speech at these times."""
    for at, who in speeches:
        turns.feed(ActionEnded(actor=who, action="speak", at=Stamp("clock", at)), at)


def asking(turns: RobotTurns, text: str, status: TurnStatus = "full", id: str = "a") -> tuple[str, ...]:
    """Those to whom this is said, the next speaker first."""
    words = (Speech(id="s", text=text),)
    fragment = TurnFragment(id=id, turn_index=1, turn_status=status, behaviors=words)
    return turns.accept(fragment, ("ann", "bob", "cy") if status != "end" else "").addressees


def among(*speeches: tuple[float, str], **config: object) -> RobotTurns:
    turns = robot_turns(**config)
    turns.feed(seen("ann", "bob", "cy"), 0.0)
    spoken(turns, *speeches)
    return turns


@pytest.mark.parametrize(
    ("text", "order"),
    [
        ("Do you see it?", ("ann", "bob", "cy")),
        ("Bob, do you see it?", ("bob", "ann", "cy")),
        ("Do you see it, CY?", ("cy", "ann", "bob")),
        ("Bob has found it. Do you see it?", ("ann", "bob", "cy")),
        ("It is a bobsled.", ("ann", "bob", "cy")),
        ("That is Bob's, isn't it?", ("ann", "bob", "cy")),
        ("Do you see what Bob has found?", ("ann", "bob", "cy")),
        ("Hey Bob, do you see it?", ("bob", "ann", "cy")),
    ],
)
def test_who_is_named_in_the_last_sentence_is_given_the_turn(text: str, order: tuple[str, ...]) -> None:
    assert asking(among(), text) == order


def test_else_who_has_been_silent_for_longest() -> None:
    assert asking(among((1.0, "ann"), (2.0, "cy"), (3.0, "bob"), (4.0, "cy")), "Well?") == ("ann", "bob", "cy")
    assert asking(among((2.0, "ann"), (1.0, "cy"), (3.0, "bob")), "Well?") == ("cy", "ann", "bob")
    assert asking(among((2.0, "ann"), (3.0, "bob")), "Well?") == ("cy", "ann", "bob")
    assert asking(among((2.0, "cy"), (3.0, "bob"), (4.0, "ann")), "Ann or Bob?") == ("bob", "ann", "cy")


def test_people_are_called_by_their_names_in_the_world() -> None:
    turns = robot_turns()
    ann, bob, cy = seen("ann", "bob", "cy").entities
    turns.feed(replace(seen(), entities=(ann, bob, replace(cy, name="Ruth"))), 0.0)

    assert asking(turns, "Ruth, do you see it?")[0] == "cy"


def test_the_turn_is_given_where_it_ends_and_not_before() -> None:
    turns = among((1.0, "ann"))

    assert asking(turns, "Bob, listen.", "beginning", "a") == ("ann", "bob", "cy")
    assert asking(turns, "Bob, well?", "end", "b") == ("bob", "ann", "cy")


def test_without_the_policy_the_order_of_the_fragment_stands() -> None:
    turns = among((1.0, "ann"), policies_off=("next-speaker",))

    assert asking(turns, "Bob, well?") == ("ann", "bob", "cy")


def test_who_is_known_by_another_id_has_spoken_all_the_same() -> None:
    turns = among((1.0, "cy"), (2.0, "x"))
    turns.feed(seen("ann", "bob", "cy", "x"), 2.0)
    spoken(turns, (3.0, "x"), (4.0, "bob"))
    turns.rename(lambda id: "ann" if id == "x" else id)

    assert asking(turns, "Well?") == ("cy", "ann", "bob")
