"""What a service told stands no longer once it has been killed, and goes on if it was only cut off."""

import asyncio

import pytest

from engage_hri.schemas.body import BodyPose, Ray, RobotState
from engage_hri.schemas.fragments import Claim, HeadOwner
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.recognition import Statistics, WindowStatistics
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.console import view
from engage_hri.services.console.web.picture import MEASURES
from tests.console.scenes import Timed, at, fed
from tests.console.test_picture import net, picture, section
from tests.console.test_seats import give, news, visitors

FACE = Claim(kind="face", priority=1, target="ann", reason="spoken to last")


def alive(service: str, run: str, time: float = 11.0) -> Timed:
    return PeerAlive(participant=service, run=run), time


def gone(service: str, time: float = 20.0) -> Timed:
    return PeerGone(participant=service), time


def engaged(actor: str, time: float) -> Timed:
    told = Statistics(
        actor=actor, at=at(time), level="engaged", reasons=("pace",), engagement=0.9,
        session=WindowStatistics(mtbce=3.0), recent=WindowStatistics(),
    )  # fmt: skip
    return told, time


def test_nobody_rules_the_head_without_generation() -> None:
    ruled: tuple[Timed, ...] = (alive("generation", "1"), (HeadOwner(owner=FACE, since=at(12.0)), 12.0))

    made = picture(*ruled, gone("generation"))
    assert (section(made, "head")["owner"], section(made, "head")["since"]) == (None, 10.0)
    cut = picture(*ruled, gone("generation"), alive("generation", "1", 21.0))
    assert section(cut, "head")["owner"]["target"] == "ann"
    restarted = picture(*ruled, gone("generation"), alive("generation", "2", 21.0))
    assert section(restarted, "head")["owner"] is None


def test_the_terminal_shows_no_owner_of_the_head_without_generation() -> None:
    scene = fed(view.feed, view.empty("robot", 10.0), (
        alive("generation", "1"), (HeadOwner(owner=FACE, waiting=(FACE,), since=at(12.0)), 12.0), gone("generation"),
    ))  # fmt: skip

    assert (scene.owner, scene.waiting) == (None, ())


def test_a_net_is_over_with_its_realizer_and_goes_on_when_it_is_told_again() -> None:
    made = picture(alive("realizer", "1"), (net("b"), 12.0), gone("realizer"))
    assert [each["over"] for each in section(made, "tokens")] == [True]

    made.feed(PeerAlive(participant="realizer", run="1"), 21.0, 21.0)
    made.feed(net("b"), 21.0, 21.0)
    assert [each["over"] for each in section(made, "tokens")] == [False]


def test_of_a_net_that_is_over_with_its_realizer_no_later_net_is_in_the_way() -> None:
    made = picture(alive("realizer", "1"), (net("b"), 12.0), gone("realizer"))
    made.feed(net("c"), 22.0, 22.0)
    made.advance(22.0)

    assert section(made, "nets") == ["c"]


def test_no_engagement_is_known_without_recognition() -> None:
    def levels(*messages: Timed) -> dict[str, tuple[str, list[str]]]:
        made = picture(alive("recognition", "1"), engaged("ann", 12.0), engaged("ben", 12.0), *messages)
        made.advance(60.0)
        shown = [section(made, name) for name in made.versions if name.startswith(MEASURES)]
        return {each["actor"]: (each["level"], each["reasons"]) for each in shown}

    known, unknown = ("engaged", ["pace"]), ("unknown", ["recognition has left the bus"])
    left, back, other = gone("recognition"), alive("recognition", "1", 21.0), alive("recognition", "2", 21.0)
    assert levels(left) == {"ann": unknown, "ben": unknown}
    assert levels(left, back) == {"ann": known, "ben": known}
    assert levels(left, other, engaged("ben", 22.0)) == {"ann": unknown, "ben": known}
    assert levels(left, other, gone("recognition", 23.0), alive("recognition", "2", 24.0))["ann"] == unknown


def test_a_body_without_control_says_nothing_and_looks_at_nothing() -> None:
    gaze = Ray(origin=(0.0, 0.0, 1.0), axis=(1.0, 0.0, 0.0))
    state = RobotState(at=at(12.0), pose=BodyPose(joints=()), gaze=gaze, looking_at="ann", speaking="Please take")
    made = picture(alive("control", "1"), (state, 12.0))
    assert section(made, "scene")["body"]["speaking"] == "Please take"

    made.feed(*gone("control"), 20.0)
    body = section(made, "scene")["body"]
    assert (body["speaking"], body["looks_at"], body["gaze"]) == ("", "", [1.0, 0.0, 0.0])


def test_a_claim_of_a_start_or_of_a_seat_is_neither_a_service_nor_news() -> None:
    claims = ("seat-0123abcd-ann", "visitor.seat-0123abcd-ann")
    made = picture(*((PeerAlive(participant=name, run="1"), 11.0) for name in (*claims, "up-0123abcd", "seat-ann")))
    made.feed(ActionBegan(actor="ann", action="look", targets=(), at=at(12.0)), 12.0, 12.0)
    for name in claims:
        made.feed(PeerGone(participant=name), 13.0, 13.0)

    others = [each["name"] for each in section(made, "health") if not each["service"]]
    assert others == ["seat-ann", "up-0123abcd"]
    assert [note["text"].split()[0] for note in section(made, "notes")] == ["up-0123abcd", "seat-ann"]


@pytest.mark.parametrize(
    ("order", "server"),
    [
        ('{"do": "tell", "text": "Hello"}', "generation"),
        ('{"do": "condition", "name": "a"}', "generation"),
        ('{"do": "inhibit", "on": true}', "generation"),
        ('{"do": "steer", "to": "hold"}', "realizer"),
        ('{"do": "faults", "fault": {"kind": "slow"}}', "control"),
    ],
)
async def test_an_order_whose_service_is_gone_says_at_once_that_it_waits_and_then_that_nobody_came(
    hub: MemoryHub, order: str, server: str
) -> None:
    async with visitors(hub, windows=1, each=1) as (visitor,):
        give(visitor, order)
        assert [each.text for each in news(visitor)] == [
            f"{server} is not on the bus: this waits for it, 5 s at most"
        ]
        await asyncio.sleep(5.1)

        (told,) = news(visitor)
        assert f"no answer within 5.0 s (is {server} running?)" in told.text


async def test_letting_the_gaze_go_waits_for_nobody(hub: MemoryHub) -> None:
    async with visitors(hub, windows=1, each=1) as (visitor,):
        give(visitor, '{"do": "inhibit", "on": false}')

        assert news(visitor) == ()
