"""Target of the robot's looks and the reason for them, in words that everybody understands. Pure.

The arbiter of the head speaks of claims, of which one owns the head (`schemas/fragments.py`). Researchers find that
beside these words.
"""

from engage_hri.schemas.fragments import Claim, ClaimKind
from engage_hri.schemas.world import World
from engage_hri.services.console.web.scene import label
from engage_hri.services.console.web.sections import ClaimShown

WHY: dict[ClaimKind, str] = {
    "inhibition": "somebody keeps its gaze there",
    "fragment": "this belongs to what it is saying",
    "glance": "nothing has passed between them for a while",
    "response": "it answers a look or a gesture",
    "hands": "this hand is moving",
    "face": "it keeps its eyes on a person while nothing else is to be seen",
    "none": "it has not seen anybody yet",
}
"""Reason by the kind of a claim, where nothing more is known."""
CLOSER: dict[tuple[ClaimKind, str], str] = {
    ("fragment", "until its block ends"): "it has not finished what it is saying",
    ("fragment", "thinks"): "it thinks about what to say next",
    ("hands", "manipulates"): "this hand is moving a thing",
    ("face", "spoken to last"): "it spoke to this person last",
    ("face", "nearest when it came"): "nobody else was nearer",
    ("face", "lost"): "the person there has gone",
}
"""Reason by the kind of a claim and the beginning of what the arbiter says."""
ANSWERED = {
    "directed gaze": "{} looked or pointed there",
    "mutual facial gaze": "{} looks at the robot",
    "adjacency pair": "{} spoke to the robot",
    "backchannel": "{} showed that they listen",
}
"""Reason of a response, by what it answers."""
KEPT = {
    "hold": "{} keeps its gaze where it is",
    "release": "{} keeps its gaze at rest",
    "target": "{} keeps its gaze there",
}
"""Reason of an inhibition, by the mode of the lease."""
SPEECH_ONLY = "speech only"


def plainly(claim: Claim, world: World) -> ClaimShown:
    """A claim in plain words, with its terms."""
    return ClaimShown(claim.kind, claim.priority, claim.target, claim.reason, _where(claim, world), _why(claim))


def _where(claim: Claim, world: World) -> str:
    """Movement of the head that the claim asks for."""
    if claim.kind == "inhibition" and claim.reason.startswith(SPEECH_ONLY):
        return "look up, past everything"
    if not claim.target:
        return "look straight ahead" if claim.kind == "none" else "keep its head where it is"
    entity = world.entity(claim.target)
    if entity is None:
        return f"look at {claim.target}"
    if entity.kind == "hand" and entity.owner:
        return f"look at a hand of {entity.owner}"
    if entity.kind == "person":
        return f"look at {entity.name or entity.id}"
    return f"look at the {label(entity)}"


def _why(claim: Claim) -> str:
    begins, _, rest = claim.reason.partition(":")
    if claim.kind == "inhibition" and begins == SPEECH_ONLY:
        return "the condition of the study leaves it words alone"
    if claim.kind == "inhibition" and rest.strip() in KEPT:
        return KEPT[rest.strip()].format(begins)
    what, of, who = claim.reason.rpartition(" of ")
    if claim.kind == "response" and of and what in ANSWERED:
        return ANSWERED[what].format(who)
    return CLOSER.get((claim.kind, begins), WHY[claim.kind])
