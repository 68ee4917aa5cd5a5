"""The annotator of where the eyes are while somebody speaks to the robot (`spoken_to.py`), on what is known."""

import pytest

from engage_hri.schemas.fragments import Claim, HeadOwner
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.units import Stamp
from engage_hri.services.simulation.party import Saying
from tests.study.robot_head import Span, moments
from tests.study.spoken_to import AtSpeakers, at_speakers


def looks(*looked: tuple[str, float, float]) -> list[Message]:
    return [
        kind(actor="robot", action="look", targets=(target,), at=Stamp("c", at))
        for target, began, ended in looked
        for kind, at in ((ActionBegan, began), (ActionEnded, ended))
    ]


def owner(at: float, kind: str, target: str) -> HeadOwner:
    return HeadOwner(owner=Claim(kind=kind, priority=1, target=target, reason=""), since=Stamp("c", at))


def to_robot(actor: str, began: float, ended: float, to: str = "robot") -> Saying:
    return Saying(actor, to, "talk", "so", began, ended)


def elsewhere(found: AtSpeakers) -> dict[str, float]:
    return {cause: round(lasted, 3) for cause, lasted in found.elsewhere.items() if lasted}


def test_of_two_who_speak_at_once_either_is_who_speaks_and_the_time_counts_once() -> None:
    found = moments([Span(1, 3, "ann"), Span(2, 4, "ben")], [Span(0, 2.5, "ann"), Span(3.5, 9, "ben")])

    assert [(each.began, each.ended, each.what, *sorted(who)) for each, who in found] == [
        (1, 2, "ann", "ann"), (2, 2.5, "ann", "ann", "ben"), (2.5, 3, "", "ann", "ben"), (3, 3.5, "", "ben"),
        (3.5, 4, "ben", "ben"),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "cause"), [("response", "another one who looks"), ("fragment", "its own turn"), ("hands", "hands")]
)
def test_what_had_the_head_meanwhile_is_told_with_the_reaction_and_the_way_apart(kind: str, cause: str) -> None:
    messages = [owner(0.0, kind, "ben"), owner(2.0, "response", "ann"), *looks(("ben", 0, 2.1), ("ann", 2.5, 9))]
    found = at_speakers(messages, [to_robot("ann", 1, 4)])

    assert (found.speeches, found.heard, found.on_face) == (1, 3.0, 1.5)
    assert elsewhere(found) == {"reaction": 0.2, cause: 0.8, "the way of the head": 0.5}


def test_another_one_who_speaks_to_somebody_else_is_no_one_who_speaks_to_it() -> None:
    messages = [owner(0.0, "response", "ben"), *looks(("ben", 0, 9))]
    found = at_speakers(messages, [to_robot("ann", 1, 2), to_robot("ben", 0, 5, "cem")])

    assert elsewhere(found) == {"reaction": 0.2, "another one who speaks": 0.8}
