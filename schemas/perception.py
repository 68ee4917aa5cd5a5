"""Raw perception, for cameras and microphones that do not say themselves who looks at what or who speaks.

Sent several times a second, newest only: a lost one costs nothing. Hands come with `World`, as entities of their own.
"""

from msgspec import Struct

from engage_hri.schemas.units import Probability, Stamp, Vector


class HeadPose(Struct, frozen=True, kw_only=True, tag="head_pose", omit_defaults=True):
    """stream: perception. Where a person's head is, and which way it faces.

    position: between the eyes, in the robot's frame, metres. direction: any length but 0, its parts at most 1e6; of
    the eyes, if the tracker sees those, else of the nose.
    """

    actor: str
    position: Vector
    direction: Vector
    at: Stamp
    confidence: Probability = 1.0


class VoiceActivity(Struct, frozen=True, kw_only=True, tag="voice_activity", omit_defaults=True):
    """stream: perception. Whether a person's voice is heard."""

    actor: str
    active: bool
    at: Stamp
    confidence: Probability = 1.0
