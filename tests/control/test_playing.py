"""Faults that a suite plays: one of each kind that the body plays, as the body means it."""

from engage_hri.schemas.body import Capabilities, FaultKind, JointLimit
from engage_hri.schemas.body_faults import BodyFault, flaw
from engage_hri.services.control.testing.truth import playable
from engage_hri.services.control.torso.body import SimulatedBody

JOINT = JointLimit(joint="tilt", part="head", low=-1.0, high=1.0, speed=1.0, acceleration=10.0)


def able(*kinds: FaultKind, faults: tuple[str, ...]) -> Capabilities:
    return Capabilities(
        body="own", types=("gaze",), parts=("head",), joints=(JOINT,), faults=faults, fault_kinds=kinds
    )


def test_a_kind_of_the_body_itself_is_played_as_it_says() -> None:
    loose = FaultKind(kind="loose", does="A screw is loose.", on="joint", amount="share", high=0.5, needs_amount=True)
    body = able(loose, faults=("loose",))

    assert playable(body) == (BodyFault(kind="loose", part="tilt", amount=0.5),)


def test_what_a_body_says_of_a_kind_counts_more_than_what_it_usually_means() -> None:
    displaced = FaultKind(kind="displaced", does="The whole head hangs.", on="part", amount="degrees", high=5.0)
    body = able(displaced, faults=("displaced",))

    assert playable(body) == (BodyFault(kind="displaced"),)


def test_a_kind_of_joints_is_left_out_where_there_are_none() -> None:
    body = Capabilities(body="voice", types=("speech",), parts=("voice",), faults=("displaced", "mute"))

    assert playable(body) == (BodyFault(kind="mute"),)


async def test_what_is_played_is_what_the_bodies_can_play() -> None:
    body = SimulatedBody()
    faults = playable(body.capabilities)

    assert [fault.kind for fault in faults] == list(body.capabilities.faults)
    assert [flaw(fault, body.capabilities) for fault in faults] == [""] * len(faults)
    for fault in faults:
        body.switch_faults([fault])
        assert body.faults == (fault,)
