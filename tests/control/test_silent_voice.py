"""The voice without sound is held to the contract, alone and as the voice of a body; it speaks as the torso does."""

import asyncio
import re
from collections.abc import Sequence

import pytest

from engage_hri.schemas.behaviors import Gaze, Mark, Speech
from engage_hri.schemas.body import BodyPose
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import InputRefused
from engage_hri.services.control.bases.drivers import made
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.body import BehaviorRefused, Body, BodyFailed, Progress, Spoke
from engage_hri.services.control.testing import WORLD, BodyContract, Stage, performed
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.control.voice.silent import SilentVoice
from tests.random_cases import trials

SPEECH = Speech(id="s", text="This piece, please: 这块。", marks=(Mark("m", 5), Mark("n", 11), Mark("o", 20)))


class TestSilentVoice(BodyContract):
    seeds = trials()

    def make(self) -> Body:
        return SilentVoice()


class TestTorsoWithSilentVoice(BodyContract):
    seeds = trials()

    def make(self) -> Body:
        return made(ControlConfig(voice="silent"))


@pytest.mark.parametrize("text", ["", "one", SPEECH.text, "no, no; no - 3.14 😊 … end"])
async def test_it_takes_the_time_that_the_voice_of_the_torso_takes(text: str) -> None:
    speech = Speech(id="s", text=text, marks=tuple(each for each in SPEECH.marks if each.position <= len(text)))
    voice, torso = SilentVoice(), SimulatedBody()
    ours, theirs = voice.estimate(speech, None, WORLD), torso.estimate(speech, None, WORLD)

    assert (ours.phases, ours.parts) == (theirs.phases, ("voice",))
    assert told(await performed(voice, speech)) == told(await performed(torso, speech))


def told(progress: Sequence[Progress]) -> list[tuple[str, float]]:
    """What was said and passed, each with the seconds since the beginning."""
    return [(one.word if isinstance(one, Spoke) else one.sync, round(one.at - progress[0].at, 9)) for one in progress]


async def test_what_is_no_speech_is_refused() -> None:
    look = Gaze(id="g", target="human")

    assert not SilentVoice().estimate(look, None, WORLD).feasible
    with pytest.raises(BehaviorRefused, match="no gaze"):
        await performed(SilentVoice(), look)


async def test_it_can_be_mute_without_knowing_and_voiceless_knowing_it() -> None:
    voice = SilentVoice()
    stage = Stage(voice, Speech(id="s", text="one two three four five"), "end")
    await asyncio.sleep(0.4)
    assert voice.state().speaking
    voice.switch_faults([BodyFault(kind="mute")])
    assert not voice.state().speaking
    voice.switch_faults([BodyFault(kind="voiceless")])
    with pytest.raises(BodyFailed, match="the voice cannot speak"):
        await stage.over()

    assert not voice.estimate(SPEECH, BodyPose(), WORLD).feasible
    with pytest.raises(InputRefused, match="cannot play 'stall'"):
        voice.switch_faults([BodyFault(kind="stall")])


MARKED_UP = {
    'one two <break time="2s"/> three': 2.91,
    'one two, <break time="2s"/> three': 2.91,
    '<break time="2s"/>one two three': 2.91,
    'one two three<break time="2s"/>': 2.91,
    'one two <break strength="strong"/> three': 1.61,
    '<prosody rate="200%">one two</prosody> three': 0.64,
    '<prosody rate="50%">one <break time="1s"/> two</prosody> three': 2.45,
}


@pytest.mark.parametrize("markup", MARKED_UP)
async def test_a_pause_and_a_rate_in_ssml_take_their_time_in_estimate_and_performance(markup: str) -> None:
    text = " ".join(re.sub("<[^>]*>", "", markup).split())
    voice, speech = SilentVoice(), Speech(id="s", text=text, markup=markup)
    estimate = voice.estimate(speech, None, WORLD)

    assert sum(phase.natural for phase in estimate.phases) == pytest.approx(MARKED_UP[markup])
    said = told(await performed(voice, speech))
    assert said[-1] == ("end", pytest.approx(MARKED_UP[markup]))
    assert [at for _, at in said[1:-1]] == pytest.approx([word.end for word in estimate.words])
    assert not estimate.degraded


def test_markup_without_effect_is_told() -> None:
    speech = Speech(id="s", text="one", markup='<say-as interpret-as="characters">one</say-as>')

    assert "<say-as> has no effect" in SilentVoice().estimate(speech, None, WORLD).degraded
