"""A fragment with words of which none is spoken has not been performed, whatever else the robot did."""

import asyncio
from collections.abc import AsyncIterator

import pytest

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, Head, Speech
from engage_hri.schemas.blocks import SpokenText
from engage_hri.schemas.body import BodyPose, Estimate
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import FragmentOutcome, TurnFragment
from engage_hri.schemas.summary import summary
from engage_hri.schemas.world import World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.requests.ends import RequestRefused
from tests.generation.partners import Partners, stage
from tests.generation.robots import Robot, robot, says, shows

NO_VOICE = "this body has no speech"


class Voiceless(SimulatedBody):
    """A head and arms that came without a loudspeaker."""

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        if isinstance(behavior, Speech):
            return Impossible("BEHAVIOR_TYPE_NOT_SUPPORTED", NO_VOICE).estimate(behavior)
        return super().estimate(behavior, pose, world)


@pytest.fixture
async def mute(hub: MemoryHub) -> AsyncIterator[Robot]:
    async with robot(hub, body=Voiceless()) as it:
        yield it


async def outcome_of(stage: Robot, fragment: TurnFragment) -> FragmentOutcome:
    outcome = await stage.send(fragment).outcome
    assert isinstance(outcome, FragmentOutcome)
    return outcome


# -- a robot without a voice --------------------------------------------------------------------------------------


async def test_a_turn_of_which_no_word_was_spoken_has_failed_and_says_why(mute: Robot) -> None:
    outcome = await outcome_of(mute, shows("a", "full", "middle", Speech(id="s", text="Do you see")))

    assert (outcome.status, outcome.spoken) == ("failed", ())
    assert str(outcome.fault) == f"a: none of its words was spoken: s, ref-phrase were dropped: {NO_VOICE}"
    assert outcome.warnings == (f"s was dropped: {NO_VOICE}", f"ref-phrase was dropped: {NO_VOICE}")


async def test_the_turn_is_aborted_and_the_next_one_is_heard_out(mute: Robot) -> None:
    await outcome_of(mute, says("a", "beginning"))
    outcome = await outcome_of(mute, TurnFragment(id="b", behaviors=(Gaze(id="g", target="middle"),)))
    await asyncio.sleep(10.0)

    assert outcome.status == "done"
    _, closed = mute.closed[0]
    assert (closed.turn, closed.status, closed.reason) == ("a", "aborted", "a failed")


async def test_the_rest_of_a_stream_goes_with_the_fragment_that_was_not_spoken(mute: Robot) -> None:
    pending = [mute.send(says(id, status)) for id, status in (("a", "beginning"), ("b", "middle"), ("c", "end"))]
    await asyncio.gather(*(each.outcome for each in pending))

    first, *others = [outcome.status for _, outcome in mute.outcomes.values()]
    assert first == "failed"
    assert set(others) <= {"failed", "interrupted"}
    assert [closed.status for _, closed in mute.closed] == ["aborted"]


@pytest.mark.parametrize("text", ["", "😊 …"])
async def test_where_there_is_nothing_to_say_nothing_is_missing(mute: Robot, text: str) -> None:
    outcome = await outcome_of(mute, says("a", "full", text, Gaze(id="g", target="middle")))

    assert (outcome.status, outcome.fault) == ("done", None)


async def test_required_words_are_refused_before_anything_moves(mute: Robot) -> None:
    with pytest.raises(RequestRefused, match=NO_VOICE):
        await mute.send(TurnFragment(id="a", behaviors=(Speech(id="s", text="one", required=True),))).accepted


# -- what the realizer may say ------------------------------------------------------------------------------------


WORDS = TurnFragment(id="a", behaviors=(Speech(id="s", text="one two"), Speech(id="t", text="three")))


async def ended(partners: Partners, status: str = "done", **fields: object) -> FragmentOutcome:
    pending = partners.send(WORDS)
    await partners.fragment_block("a")
    partners.end(partners.request("a"), status, **fields)
    outcome = await pending.outcome
    assert isinstance(outcome, FragmentOutcome)
    return outcome


@pytest.mark.parametrize(
    ("fields", "status"),
    [
        ({"dropped": ("s", "t")}, "failed"),
        ({"dropped": ("s",), "interrupted": ("t",)}, "failed"),
        ({"dropped": ("s", "t"), "spoken": (SpokenText(behavior="t", text="…", complete=False),)}, "failed"),
        ({"dropped": ("s",), "spoken": (SpokenText(behavior="t", text="three"),)}, "done"),
        ({"dropped": ("s", "t"), "spoken": (SpokenText(behavior="s", text="one", complete=False),)}, "done"),
        ({"interrupted": ("s", "t")}, "done"),
        ({"dropped": ("turn-gaze",)}, "done"),
    ],
)
async def test_one_spoken_word_is_enough_and_what_nobody_wanted_is_not_missed(
    hub: MemoryHub, fields: dict[str, object], status: str
) -> None:
    async with stage(hub) as partners:
        outcome = await ended(partners, **fields)

    assert outcome.status == status
    assert (outcome.fault is not None) == (status == "failed")


@pytest.mark.parametrize(
    ("fields", "unsaid"),
    [
        ({"dropped": ("s",), "spoken": (SpokenText(behavior="t", text="three"),)}, ("s",)),
        ({"interrupted": ("t",), "spoken": (SpokenText(behavior="s", text="one two"),)}, ("t",)),
        ({"spoken": (SpokenText(behavior="s", text="one two"), SpokenText(behavior="t", text="three"))}, ()),
    ],
)
async def test_a_speech_of_which_no_word_came_makes_the_words_of_the_fragment_cut_short(
    hub: MemoryHub, fields: dict[str, object], unsaid: tuple[str, ...]
) -> None:
    async with stage(hub) as partners:
        outcome = await ended(partners, **fields)

    assert (outcome.status, outcome.unsaid) == ("done", unsaid)
    assert summary(outcome).cut_short == bool(unsaid)


async def test_a_fragment_without_words_of_which_nothing_was_performed_fails_and_its_turn_goes_on(
    hub: MemoryHub,
) -> None:
    async with stage(hub) as partners:
        nod = TurnFragment(id="a", turn_status="beginning", behaviors=(Head(id="n", lexeme="NOD"),))
        pending = [partners.send(nod), partners.send(says("b", "end"))]
        block = await partners.fragment_block("a")
        await partners.fragment_block("b")
        gone = tuple(each.id for each in block.behaviors)
        fault = Fault(reason="no behavior of it came to its end", service="realizer")
        partners.end(partners.request("a"), "failed", dropped=gone, reasons=("tired",) * len(gone), fault=fault)
        partners.end(partners.request("b"))
        outcomes = [await each.outcome for each in pending]

    assert [(each.status, each.fault) for each in outcomes if isinstance(each, FragmentOutcome)] == [
        ("failed", fault), ("done", None)
    ]  # fmt: skip


async def test_an_interrupted_fragment_stays_interrupted(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        outcome = await ended(partners, "interrupted", dropped=("s", "t"))

    assert outcome.status == "interrupted"


async def test_a_realizer_that_gives_no_reasons_is_believed_all_the_same(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        outcome = await ended(partners, dropped=("s", "t"), reasons=("no sound card",))

    assert outcome.fault is not None
    assert outcome.fault.reason == "none of its words was spoken: s, t were dropped: no sound card"
    assert outcome.warnings == ("s was dropped: no sound card", "t was dropped")
