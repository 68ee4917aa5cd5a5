"""A robot that says "mm-hmm" to who tells it something long: and what recognition makes of that."""

import asyncio

import pytest

from engage_hri import PerceivedPerson, Utterance, embedded, perceive
from engage_hri.schemas import keys
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.messages import Message
from engage_hri.schemas.recognition import ConnectionEvent, Floor, Interjection
from engage_hri.services.commandline.embedding import EmbeddedRobot

PHRASES = (
    "I was in the park today",
    "there was a dog",
    "it had a red ball",
    "and it gave me the ball",
    "so I threw it",
)


async def echo(robot: EmbeddedRobot, ann: PerceivedPerson) -> None:
    """Hear the robot's words by ann's microphone, as words of hers."""
    with robot.hub.join("microphone").subscribe(keys.SYNC_POINT, capacity=100) as inbox:
        while (received := await inbox.next()) is not None:
            if isinstance(received.message, WordSpoken):
                word, began = received.message.word, ann.stamp(ago=0.3)
                ann.tell(Utterance(actor="ann", id=f"echo {began.seconds}", text=word, began=began, at=ann.stamp()))


async def tell_story(robot: EmbeddedRobot, ann: PerceivedPerson) -> None:
    """Say the phrases, each for 3 s and with a pause of 1 s behind."""
    began, text = ann.stamp(), ""
    ann.begin("speak", robot.id)
    for phrase in PHRASES:
        for word in phrase.split():
            text = f"{text} {word}".strip()
            ann.tell(
                Utterance(
                    actor="ann", id="story", text=text, began=began, at=ann.stamp(), final=False, to=(robot.id,)
                )
            )
            await asyncio.sleep(3.0 / len(phrase.split()))
        await asyncio.sleep(1.0)
    ann.end("speak", robot.id)
    ann.tell(Utterance(actor="ann", id="story", text=text, began=began, at=ann.stamp(), to=(robot.id,)))


@pytest.mark.parametrize("off", [(), ("continuers",), ("continuers", "nods")])
async def test_who_tells_a_story_hears_that_the_robot_listens_and_nobody_takes_it_for_a_turn(
    off: tuple[str, ...],
) -> None:
    async with (
        embedded(human="none", settings=[f"generation.policies_off={[*off]}".replace("'", '"')]) as robot,
        perceive("ann", hub=robot.hub) as ann,
    ):
        await ann.look_at(robot.id)
        await asyncio.sleep(1.0)
        with robot.hub.join("listener").subscribe(keys.EVERYTHING, capacity=10**6) as inbox:
            echoing = asyncio.create_task(echo(robot, ann))
            await tell_story(robot, ann)
            await asyncio.sleep(3.0)
            assert not echoing.done()
            echoing.cancel()
            told: list[Message] = []
            while len(inbox) and (received := await inbox.next()):
                told.append(received.message)

    echoes = [each for each in told if isinstance(each, Utterance) and each.id != "story"]
    words = [each.word for each in told if isinstance(each, WordSpoken)]
    signs = {each.id for each in told if isinstance(each, ConnectionEvent) and each.kind == "backchannel"}
    assert len(echoes) == len(words)
    assert (words[:1], bool(signs)) == ([] if off else ["mm-hmm"], "nods" not in off)
    pairs = [each for each in told if isinstance(each, ConnectionEvent) and each.kind == "adjacency_pair"]
    assert {(each.initiator, each.id) for each in pairs} == {("ann", pairs[0].id)}
    assert "succeeded" not in {each.state for each in pairs}, "nothing of it is an answer"
    assert not [each for each in told if isinstance(each, Interjection)]
    assert robot.id not in {each.actor for told in told if isinstance(told, Floor) for each in told.speeches}
