"""Raw perception, from cameras and microphones that do not themselves report looks and speech.

Sent several times a second; only the newest counts, so a lost one costs nothing. Hands come with `World`, as
entities.
"""

from msgspec import Struct

from engage_hri.schemas.units import Probability, Stamp, Vector


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
