"""People are lost with the perception that reports them."""

from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.presence import PeerAlive, PeerGone
from engage_hri.services.recognition.perceive.reporters import Reporters
from tests.recognition.observations import stamp

ALIVE, GONE = PeerAlive(participant="cameras", run="one"), PeerGone(participant="cameras")


def watching(*messages: object) -> list[ActorLost | ActorFound | ActionBegan]:
    """What follows, after "cameras" have told of ann and bob and others of eve."""
    reporters = Reporters()
    changes = reporters.feed(ALIVE, "", stamp(0.0))
    changes += reporters.feed(ActorFound(actor="bob", at=stamp(1.0)), "cameras", stamp(1.0))
    changes += reporters.feed(ActionBegan(actor="ann", action="speak", at=stamp(1.0)), "cameras", stamp(1.0))
    changes += reporters.feed(ActionBegan(actor="eve", action="speak", at=stamp(1.0)), "others", stamp(1.0))
    for at, message in enumerate(messages, 2):
        changes += reporters.feed(message, "", stamp(at))  # type: ignore[arg-type]
    return changes


def test_who_is_reported_by_a_perception_is_lost_with_it():
    assert watching(GONE) == [ActorLost(actor="ann", at=stamp(2.0)), ActorLost(actor="bob", at=stamp(2.0))]


def test_they_are_found_when_it_was_only_out_of_reach():
    found = [ActorFound(actor="ann", at=stamp(3.0)), ActorFound(actor="bob", at=stamp(3.0))]
    going = [ActionBegan(actor="ann", action="speak", at=stamp(3.0))]

    assert watching(GONE, ALIVE)[2:] == found + going


def test_they_go_on_with_what_they_did_but_not_with_what_had_ended():
    """A look lasts until the next; one of two things that are pointed at is not pointed at any more."""
    reporters = Reporters()
    reporters.feed(ALIVE, "", stamp(0.0))
    for action, target, at in (
        ("look", "cup", 1.0),
        ("look", "robot", 2.0),
        ("point", "a", 3.0),
        ("point", "b", 4.0),
    ):
        began = ActionBegan(actor="ann", action=action, targets=(target,), at=stamp(at))
        reporters.feed(began, "cameras", stamp(at))
    for action, target in (("look", "cup"), ("point", "a"), ("nod", "a")):
        ended = ActionEnded(actor="ann", action=action, targets=(target,), at=stamp(5.0))
        reporters.feed(ended, "cameras", stamp(5.0))
    reporters.feed(GONE, "", stamp(6.0))

    assert reporters.feed(ALIVE, "", stamp(7.0)) == [
        ActorFound(actor="ann", at=stamp(7.0)),
        ActionBegan(actor="ann", action="look", targets=("robot",), at=stamp(7.0)),
        ActionBegan(actor="ann", action="point", targets=("b",), at=stamp(7.0)),
    ]


def test_who_had_left_before_is_not_found_again():
    reporters = Reporters()
    reporters.feed(ALIVE, "", stamp(0.0))
    for found in (ActorFound(actor="ann", at=stamp(1.0)), ActorFound(actor="bob", at=stamp(1.0))):
        reporters.feed(found, "cameras", stamp(1.0))
    reporters.feed(ActorLost(actor="ann", at=stamp(2.0)), "cameras", stamp(2.0))

    assert reporters.feed(GONE, "", stamp(3.0)) == [ActorLost(actor="bob", at=stamp(3.0))]
    assert reporters.feed(ALIVE, "", stamp(4.0)) == [ActorFound(actor="bob", at=stamp(4.0))]


def test_another_life_of_it_has_yet_to_see_them():
    assert watching(GONE, PeerAlive(participant="cameras", run="two"))[2:] == []


def test_others_who_come_and_go_change_nothing():
    assert watching(PeerGone(participant="generation"), PeerAlive(participant="generation", run="x")) == []
