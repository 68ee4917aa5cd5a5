"""Raw perception, from cameras and microphones that do not themselves report looks and speech; and people's words.

Raw perception is sent several times a second; only the newest counts, so a lost one costs nothing. Hands come with
`World`, as entities.
"""

from typing import Annotated

from msgspec import Meta, Struct

from engage_hri.schemas.units import Probability, Stamp, Vector

LONGEST_TEXT = 4000
"""Letters of one utterance. A minute of speech has some 900."""
MOST_ADDRESSEES = 64
LONGEST_ID = 200
UtteranceId = Annotated[str, Meta(min_length=1, max_length=LONGEST_ID)]


class HeadPose(Struct, frozen=True, kw_only=True, tag="head_pose", omit_defaults=True):
    """stream: perception. Position and direction of a person's head.

    position: between the eyes, in the robot's frame, metres.
    direction: of the eyes if the tracker sees them, else of the nose; of any length but 0, its parts at most 1e6.
    """

    actor: str
    position: Vector
    direction: Vector
    at: Stamp
    confidence: Probability = 1.0


class VoiceActivity(Struct, frozen=True, kw_only=True, tag="voice_activity", omit_defaults=True):
    """stream: perception. Voice of a person, heard or not."""

    actor: str
    active: bool
    at: Stamp
    confidence: Probability = 1.0


class Utterance(Struct, frozen=True, kw_only=True, tag="utterance", omit_defaults=True):
    """evt: perception. Words of a person: spoken ones as a recognizer understands them, or a line that was typed.

    Told anew whenever more of the words is known: of the messages with one id the one with the latest `at` counts,
    and a final one before those that are not.

    actor: who says it. id: the same for all results of one utterance of this person, and never used again.
    text: all of it so far; empty: words will follow. final: False: a partial result, which the next may change.
    began: when they began to say it; of a typed line the same as `at`. ended: when they had said it; None: by `at`.
    at: when this much was known. to: ids of those to whom it was said, if perception knows. confidence: in the words.
    """

    actor: str
    id: UtteranceId
    text: Annotated[str, Meta(max_length=LONGEST_TEXT)]
    began: Stamp
    at: Stamp
    ended: Stamp | None = None
    final: bool = True
    to: Annotated[tuple[str, ...], Meta(max_length=MOST_ADDRESSEES)] = ()
    confidence: Probability = 1.0
