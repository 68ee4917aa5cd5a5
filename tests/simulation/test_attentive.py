"""The attentive person: follows looks and points, meets the robot's eyes, answers what it has said."""

from functools import partial

import pytest

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.blocks import BlockProgress
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.perception import ActionBegan, ActionEnded, Utterance
from engage_hri.schemas.units import Stamp
from engage_hri.services.simulation.company import AttentiveHuman, Bystander
from engage_hri.services.simulation.human import FACE, Act, Grab, Lay, LookAt, Start, Stop
from engage_hri.services.tangram.people.stochastic import requested_placement
from engage_hri.services.tangram.table import tangram_table

AT = Stamp("loop", 0.0)
ASKED = partial(requested_placement, table=tangram_table())


def person() -> AttentiveHuman:
    return AttentiveHuman("ann", frozenset({"cup", "ball"}), "robot")


def robot_does(action: Action, target: str) -> ActionBegan:
    return ActionBegan(actor="robot", action=action, targets=(target,), at=AT)


def says(human: AttentiveHuman, text: str, now: float) -> None:
    for number, word in enumerate(text.split()):
        human.feed(WordSpoken(block="b", behavior="s", word=word, position=number, at=AT), now)
    human.feed(BlockProgress(block="b", progress="end", at=AT, status="done"), now)


def acts(human: AttentiveHuman, now: float) -> tuple[Act, ...]:
    found: tuple[Act, ...] = ()
    while some := human.due(now):
        found += some
    return found


@pytest.mark.parametrize("action", ["look", "point"])
@pytest.mark.parametrize(("target", "where"), [("cup", "cup"), ("ann", FACE)])
def test_they_look_where_the_robot_looks_and_points(action: Action, target: str, where: str) -> None:
    human = person()
    human.feed(robot_does(action, target), 1.0)

    assert human.deadline == 1.0 + AttentiveHuman.FOLLOWS
    pointed = action == "point" and where == "cup"
    assert acts(human, 1.0 + AttentiveHuman.FOLLOWS) == (LookAt(where, pointed=pointed),)


def test_they_see_only_what_there_is_and_mind_only_the_robot() -> None:
    human = person()
    human.feed(robot_does("look", "somewhere"), 1.0)
    human.feed(ActionBegan(actor="carl", action="look", targets=("cup",), at=AT), 1.0)

    assert human.deadline is None


def test_they_nod_when_it_has_spoken_but_not_when_it_only_thinks() -> None:
    human = person()
    says(human, "ummmm", 1.0)
    assert human.deadline is None

    says(human, "That is a cup.", 2.0)

    assert human.deadline == 2.0 + AttentiveHuman.ANSWERS
    answer = acts(human, 3.0)
    assert (answer[0], answer[2], answer[-1]) == (Start("nod"), Stop("nod"), LookAt(FACE))


def test_they_answer_a_question_in_words() -> None:
    human = person()
    says(human, "Is that a cup?", 2.0)

    body = Bystander("ann", "robot", "life")
    told = [message for act in acts(human, 3.0) for message in body.does(act, AT)]
    words = [(each.id, each.text, each.final) for each in told if isinstance(each, Utterance)]
    assert words == [("life-1", "", False), ("life-1", "Yes.", True)]


def test_at_the_tangram_table_they_do_what_is_asked() -> None:
    says(
        human := AttentiveHuman("ann", frozenset(), asked=ASKED),
        "Move the blue square so that it is touching the top of the rectangle",
        1.0,
    )

    done = acts(human, 3.0)
    assert [type(each) for each in done if isinstance(each, Grab | Lay)] == [Grab, Lay]


def test_what_others_see_of_them_has_an_end_for_each_beginning() -> None:
    body = Bystander("ann", "robot")
    seen = [
        message
        for act in (LookAt("cup"), LookAt("cup"), LookAt(FACE), Start("nod"), Stop("nod"), LookAt("cup"))
        for message in body.does(act, AT)
    ]

    told = [("+" if isinstance(each, ActionBegan) else "-", each.action, *each.targets) for each in seen]
    assert told == [
        ("+", "look", "cup"), ("-", "look", "cup"), ("+", "look", "robot"), ("+", "nod"), ("-", "nod"),
        ("-", "look", "robot"), ("+", "look", "cup"),
    ]  # fmt: skip
    assert all(isinstance(each, ActionBegan | ActionEnded) for each in seen)
