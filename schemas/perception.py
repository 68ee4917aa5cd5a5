"""Things seen and heard: actions of people (from perception) and of the robot (from its sync points as realised),
people's words, and raw perception, from cameras and microphones that do not themselves report looks and speech.

Actions are told twice: each change as an event, and after it, as a state, what goes on now. The state is for readers
that come late, or have missed an event. Raw perception is sent several times a second; only the newest counts, so a
lost one costs nothing. Hands come with `World`, as entities.
"""

from math import pi
from typing import Annotated

from msgspec import Meta, Struct

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.units import Probability, Stamp, Vector


class ActionBegan(Struct, frozen=True, kw_only=True, tag="action_began", omit_defaults=True):
    """evt: an actor has begun an action. A new `look` ends the actor's previous one.

    targets: entity ids; an actor's id means the face; empty: `look` goes away from everything, others have no target.
    one_of: it is at one of the targets, and perception cannot tell at which. confidence: that this is so.
    behavior: of the robot, `block:behavior`; empty for people.
    """

    actor: str
    action: Action
    at: Stamp
    targets: tuple[str, ...] = ()
    one_of: bool = False
    confidence: Probability = 1.0
    behavior: str = ""


class ActionEnded(Struct, frozen=True, kw_only=True, tag="action_ended", omit_defaults=True):
    """evt: the action that `ActionBegan` told of, with the same actor, action and targets, has ended."""

    actor: str
    action: Action
    at: Stamp
    targets: tuple[str, ...] = ()
    confidence: Probability = 1.0
    behavior: str = ""


ANOTHER_ID = "`same_as` takes the id of a person, or the own id, which takes back what was said before"
"""What to do where `ActorFound.same_as` was no person's id."""


class ActorFound(Struct, frozen=True, kw_only=True, tag="actor_found", omit_defaults=True):
    """evt: perception sees this person, for the first time or again.

    same_as: another id that it has told of, of the same person: it has found out so. Events of both are told under
    that one from now on, and those of before once more. It corrects what was told so of `actor` before; the own id
    takes that back.
    """

    actor: str
    at: Stamp
    same_as: str = ""


class ActorLost(Struct, frozen=True, kw_only=True, tag="actor_lost", omit_defaults=True):
    """evt: perception no longer sees this person. Connection events that are open with them end.

    left: it knows that they went away. Else another id that is found there soon may be the same person.
    """

    actor: str
    at: Stamp
    left: bool = False


class OngoingActions(Struct, frozen=True, kw_only=True, tag="ongoing_actions", omit_defaults=True):
    """state: all that an actor does now, as one reporter knows it: perception of a person, control of the robot.

    Published after each event of the actor, so that its reader knows all earlier ones.

    at: the instant of the last change; what is missing here has ended by then.
    """

    actor: str
    at: Stamp
    actions: tuple[ActionBegan, ...] = ()
    """The actions that go on, each as its `ActionBegan` was told, the oldest first."""
    seen: bool | None = None
    """True: perception sees the person, as by `ActorFound`; False: it has lost the person; None: this reporter does
    not tell. Of somebody who is lost, `actions` are those that go on if the person is found again."""


LONGEST_TEXT = 4000
"""Letters of one utterance. A minute of speech has some 900."""
MOST_ADDRESSEES = 64
LONGEST_ID = 200
Spread = Annotated[float, Meta(ge=0, le=pi, description="radians")]
UtteranceId = Annotated[str, Meta(min_length=1, max_length=LONGEST_ID)]


class HeadPose(Struct, frozen=True, kw_only=True, tag="head_pose", omit_defaults=True):
    """stream: perception. Position and direction of a person's head.

    position: between the eyes, in the robot's frame, metres.
    direction: of the eyes if the tracker sees them, else of the nose; of any length but 0, its parts at most 1e6.
    yaw_spread, pitch_spread: standard deviation of the direction to the side and up, radians; None: not known.
    mouth: gap between the lips, as a share of the height of the face; None: not seen.
    """

    actor: str
    position: Vector
    direction: Vector
    at: Stamp
    confidence: Probability = 1.0
    yaw_spread: Spread | None = None
    pitch_spread: Spread | None = None
    mouth: Probability | None = None


class Looked(Struct, frozen=True, kw_only=True, tag="looked", omit_defaults=True):
    """stream: perception. A source of head poses has looked until now, and whom it saw.

    Only this says that a face is not there: a source that tells nothing stalls, and nobody has gone by that.

    at: when the picture was taken. seen: people whose face was in it; missed: people whom it follows, and whose face
    was not.
    """

    at: Stamp
    seen: tuple[str, ...] = ()
    missed: tuple[str, ...] = ()


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
    finished: how sure it is by its sound that the person has finished, and does not go on after the silence that has
    come; None: nobody judges that.
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
    finished: Probability | None = None


MOST_SAMPLES = 16 * 1024
"""Bytes of one frame: half a second at 16 kHz."""


class SoundFrame(Struct, frozen=True, kw_only=True, tag="sound_frame", omit_defaults=True):
    """stream: a short piece of sound, one channel, 16 bit, little-endian.

    A frame without samples says that what was told before is not heard from `at` on: a voice was interrupted, or a
    microphone is off.

    at: when the first sample was picked up, or is to be heard. rate: samples per second. number: counts the frames
    of this source; where one is left out, a frame was lost.
    """

    at: Stamp
    rate: Annotated[int, Meta(ge=4000, le=192_000)]
    samples: Annotated[bytes, Meta(max_length=MOST_SAMPLES)] = b""
    number: Annotated[int, Meta(ge=0)] = 0

    def __post_init__(self) -> None:
        if len(self.samples) % 2:
            raise ValueError(f"samples of {len(self.samples)} bytes: expected two for each")


FACE_POINTS = 468
"""Points of a face, in the order of the face mesh of MediaPipe, which browsers and Python have alike."""
EIGHTHS = 8
"""Steps of a coordinate in one pixel."""
_BYTES = FACE_POINTS * 3 * 2
MOST_FACES = 16
Pixels = Annotated[int, Meta(ge=16, le=4096)]


class FacePoints(Struct, frozen=True, kw_only=True, tag=False, omit_defaults=True):
    """Points of one face in a picture.

    points: x to the right, y down, and depth away from the camera in the same scale, of each point, in eighths of a
    pixel; 16 bit, little-endian. confidence: that it is a face.
    """

    points: Annotated[bytes, Meta(min_length=_BYTES, max_length=_BYTES)]
    confidence: Probability = 1.0


class FaceLandmarks(Struct, frozen=True, kw_only=True, tag="face_landmarks", omit_defaults=True):
    """stream: perception. All faces that a source has found in one picture; none: it has looked, and saw nobody.

    at: when the picture was taken; the source has looked until then. width, height: of the picture, in pixels.
    over: there was no picture: the source, which people switch on and off, looks no more.
    """

    at: Stamp
    width: Pixels
    height: Pixels
    faces: Annotated[tuple[FacePoints, ...], Meta(max_length=MOST_FACES)] = ()
    over: bool = False
