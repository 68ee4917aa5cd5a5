"""Blocks made from fragments, and their constraints as lines of text."""

from collections.abc import Collection, Sequence

from engage_hri.schemas.behaviors import (
    After,
    Before,
    Behavior,
    Reference,
    Speech,
    SpeechOption,
    Synchronize,
)
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.check import check
from engage_hri.schemas.fragments import GestureChoice, ReferenceChoice, TurnFragment
from engage_hri.services.generation.block.emission import Emission, FragmentPlan
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.inhibitions import Permits
from engage_hri.services.generation.turns.continuation import NO_CONTINUATION, Continuation
from engage_hri.services.generation.turns.plan import plan_turn

POINT: GestureChoice = "directed_gaze_with_pointing"
LOOK: GestureChoice = "directed_gaze"
Made = tuple[GestureChoice, str]


def speech(id: str, text: str = "words", **fields: object) -> Speech:
    return Speech(id=id, text=text, **fields)  # type: ignore[arg-type]


def reference(id: str, target: str = "piece", **fields: object) -> Reference:
    options = (SpeechOption(text="it", cost=1),)
    return Reference(id=id, target=target, minimum_reliability=0.5, options=options, **fields)  # type: ignore[arg-type]


def emission(
    fragment: TurnFragment,
    made: Sequence[Made] = (),
    profile: str = "check-back",
    permits: Permits | None = None,
    hands: dict[str, str] | None = None,
    before: Continuation = NO_CONTINUATION,
    apart: Collection[str] = (),
) -> FragmentPlan:
    """`made`: gesture and phrase of each reference in document order."""
    references = [behavior for behavior in fragment.behaviors if isinstance(behavior, Reference)]
    choices = [
        ReferenceChoice(
            reference=each.id, target=each.target, gesture=gesture, phrase=phrase, reliability=0.9, cost=1.0
        )
        for each, (gesture, phrase) in zip(references, made, strict=True)
    ]
    config = GenerationConfig(profile=profile)  # type: ignore[arg-type]
    turn = plan_turn(fragment, "turn", fragment.addressee or "human")
    result = Emission(fragment, turn, choices, config, permits or Permits(), hands or {}, before, apart).plan()  # type: ignore[arg-type]
    check(result.block)  # every reference of the block is sound
    return result


def block(*args: object, **fields: object) -> Block:
    return emission(*args, **fields).block  # type: ignore[arg-type]


def lines(block: Block, *ids: str) -> list[str]:
    """The constraints (of those ids) as text: `a = b`, `a after b`, `a before b`."""
    text = []
    for constraint in block.constraints:
        if ids and constraint.id not in ids:
            continue
        for operator in constraint.operators:
            word = {Synchronize: "=", After: "after", Before: "before"}[type(operator)]
            text += [f"{sync} {word} {operator.ref}" for sync in operator.syncs]
    return text


def by_id(block: Block) -> dict[str, Behavior]:
    return {behavior.id: behavior for behavior in block.behaviors}


def start_of(behavior: Behavior) -> str:
    return next((timing.ref for timing in behavior.timing if timing.sync == "start"), "")
