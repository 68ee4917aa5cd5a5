"""Behaviors that fall with what they need."""

from engage_hri.schemas.behaviors import Event, Gaze, Head, Speech, Timing
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import Estimate
from engage_hri.services.realizer.plan.planner import plan_block

REFUSED = [Estimate(behavior="look", feasible=False)]


def contact(*needs: str) -> Event:
    return Event(id="contact", kind="mutual_facial_gaze", responder="ann", needs=needs)


def test_an_event_falls_with_the_gaze_that_it_is_about() -> None:
    plan = plan_block(Block(id="b", behaviors=(Gaze(id="look", target="ann"), contact("look"))), REFUSED)

    assert plan.dropped == ("look", "contact")


def test_an_event_that_names_nothing_goes_on() -> None:
    plan = plan_block(Block(id="b", behaviors=(Gaze(id="look", target="ann"), contact())), REFUSED)

    assert plan.dropped == ("look",)


def test_what_needs_something_that_falls_falls_too_and_all_else_stays() -> None:
    this = Speech(id="this", text="this", needs=("look",))
    rest = Speech(id="rest", text="from the table", needs=("this",))
    nod = Head(id="nod", lexeme="NOD")

    plan = plan_block(Block(id="b", behaviors=(rest, this, nod, Gaze(id="look", target="cup"))), REFUSED)

    assert set(plan.dropped) == {"look", "this", "rest"}
    assert set(plan.chains) == {"nod"}


def test_what_needs_something_that_cannot_be_on_time_falls_with_it() -> None:
    late = Gaze(id="look", target="cup", timing=(Timing("start", "1.0"), Timing("end", "1.01")))
    this = Speech(id="this", text="this", needs=("look",))

    plan = plan_block(Block(id="b", behaviors=(late, this, Speech(id="rest", text="cup", needs=("this",)))), [])

    assert plan.dropped == ("look", "this", "rest")
    assert not plan.chains
