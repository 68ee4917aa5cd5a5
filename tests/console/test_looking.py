"""Where the robot looks and why, in plain words: each reason that the arbiter of the head gives has its own."""

import pytest

from engage_hri.schemas.fragments import Claim
from engage_hri.schemas.world import Entity, World
from engage_hri.services.console.web.scene import plainly

ANN = Entity(id="ann", kind="person", position=(1.2, 0.0, 1.2))
HAND = Entity(id="ann-hand", kind="hand", owner="ann", position=(1.0, 0.0, 0.8))
PIECE = Entity(id="blue-square", kind="object", color="blue", shape="square", position=(0.5, 0.0, 0.7))
WORLD = World(entities=(ANN, HAND, PIECE))


@pytest.mark.parametrize(
    ("kind", "target", "reason", "does", "why"),
    [
        ("none", "", "nobody has been seen", "look straight ahead", "it has not seen anybody yet"),
        ("face", "ann", "spoken with last", "look at ann", "it spoke with this person last"),
        ("face", "ann", "is to answer: others are, too", "look at ann",
         "an answer of this person or another is awaited"),
        ("face", "ann", "nearest when it came", "look at ann", "nobody else was nearer"),
        ("face", "", "lost: hold the direction", "keep its head where it is", "the person there has gone"),
        ("hands", "ann-hand", "moves", "look at a hand of ann", "this hand is moving"),
        ("hands", "ann-hand", "manipulates", "look at a hand of ann", "this hand is moving a thing"),
        ("response", "blue-square", "directed gaze of ann", "look at the blue square", "ann looked or pointed there"),
        ("response", "ann", "mutual facial gaze of ann", "look at ann", "ann looks at the robot"),
        ("glance", "ann", "quiet for 4.2 s", "look at ann", "nothing has passed between them for a while"),
        ("fragment", "blue-square", "ref-2-gaze", "look at the blue square", "this belongs to what it is saying"),
        ("fragment", "ann", "until its block ends", "look at ann", "it has not finished what it is saying"),
        ("fragment", "table", "thinks", "look at table", "it thinks about what to say next"),
        ("inhibition", "", "anna: hold", "keep its head where it is", "anna keeps its gaze where it is"),
        ("inhibition", "ann", "anna: target", "look at ann", "anna keeps its gaze there"),
        ("inhibition", "", "speech only: head up right", "look up, past everything",
         "the condition of the study leaves it words alone"),
    ],
)  # fmt: skip
def test_a_claim_has_plain_words(kind: str, target: str, reason: str, does: str, why: str) -> None:
    shown = plainly(Claim(kind=kind, priority=3, target=target, reason=reason), WORLD)

    assert (shown.does, shown.why) == (does, why)
    assert (shown.kind, shown.reason) == (kind, reason)
