"""Random valid blocks and turn fragments: whatever the structs can hold and `schemas/check.py` accepts."""

from typing import get_args

from hypothesis import strategies as st
from msgspec.structs import replace

from engage_hri.schemas import behaviors as of
from engage_hri.schemas.behavior_types import SYNC_POINTS
from engage_hri.schemas.blocks import Block, Composition, Dialect
from engage_hri.schemas.fragments import TurnFragment, TurnStatus
from engage_hri.schemas.references import AnyBehavior, AnyInput, SyncRef

# Letters that XML must escape, white space that it would collapse, and some beyond ASCII.
LETTERS = "ab cXYZ09<>&\"'\t\n-:é€😀"
words = st.text(LETTERS, max_size=12)
some = st.text(LETTERS, min_size=1, max_size=12)
"""Words that are there: in a draft an empty one is missing, and the behavior is none."""
ids = st.from_regex(r"[a-z][a-z0-9]{0,3}(-[0-9]{1,2})?", fullmatch=True).filter(lambda id: id != "bml")
amounts = st.floats(0, 1)
numbers = st.floats(allow_nan=False, allow_infinity=False)
hands = st.none() | st.sampled_from(get_args(of.Hand))
sides = st.sampled_from(["LEFT", "RIGHT", "BOTH"])
actions = st.lists(st.sampled_from(get_args(of.Action)), max_size=3).map(tuple)
offsets = st.floats(-1e3, 1e3).map(lambda number: number + 0.0)


expressions = st.just(()) | st.lists(
    st.builds(of.Expression, lexeme=words, amount=st.none() | amounts)
    | st.builds(of.Expression, au=st.integers(1, 60), side=sides),
    min_size=2, max_size=3,
).map(tuple)  # fmt: skip
poses = st.lists(st.builds(of.PartPose, lexeme=words, part=words), min_size=2, max_size=3).map(tuple)


@st.composite
def speeches(draw: st.DrawFn) -> of.Speech:
    text = draw(words)
    names = draw(st.lists(ids.filter(lambda id: id not in ("start", "end")), unique=True, max_size=3))
    positions = sorted(draw(st.integers(0, len(text))) for _ in names)
    marks = tuple(of.Mark(name, position) for name, position in zip(names, positions, strict=True))
    markup = draw(st.just("") | words | st.just('<prosody rate="slow">a</prosody>'))
    return of.Speech(id="", text=text, marks=marks, markup=markup)


KINDS = [
    st.builds(of.Gaze, id=st.just(""), target=words, influence=words, offset_angle=numbers),
    st.builds(of.GazeShift, id=st.just(""), target=words, offset_direction=words),
    st.builds(of.Pointing, id=st.just(""), target=some, mode=hands),
    st.builds(of.Gesture, id=st.just(""), lexeme=some, mode=hands),
    st.builds(of.Head, id=st.just(""), lexeme=some, repetition=st.integers(1, 9), amount=amounts),
    st.builds(of.HeadDirectionShift, id=st.just(""), target=words),
    st.builds(of.Face, id=st.just(""), amount=amounts, overshoot=numbers, expressions=expressions),
    st.builds(of.FaceLexeme, id=st.just(""), lexeme=words, amount=amounts),
    st.builds(of.FaceFacs, id=st.just(""), au=st.integers(1, 60), side=sides, amount=amounts),
    st.builds(of.FaceShift, id=st.just(""), lexeme=words, au=st.integers(0, 60), side=sides),
    st.builds(of.FaceShift, id=st.just(""), amount=amounts, expressions=expressions.filter(bool)),
    st.builds(of.Posture, id=st.just(""), stance=words, lexeme=words, part=words),
    st.builds(of.PostureShift, id=st.just(""), stance=words),
    st.builds(of.Posture, id=st.just(""), stance=words, poses=poses),
    st.builds(of.Pose, id=st.just(""), lexeme=words, part=words),
    st.builds(of.Locomotion, id=st.just(""), target=some, manner=words),
    st.builds(of.Wait, id=st.just(""), duration=st.none() | st.floats(0, 1e6)),
    st.builds(of.Emit, id=st.just(""), event=words),
    speeches(),
    st.builds(
        of.Event, id=st.just(""), kind=st.sampled_from(get_args(of.EventKind)), responder=words,
        objects=st.lists(words, max_size=2).map(tuple), cause=st.sampled_from(get_args(of.Cause)),
        optional=st.booleans(), accept=actions, limit=st.none() | st.floats(0.1, 1e3), turn=words,
    ),
    st.builds(of.TurnSignal, id=st.just(""), turn=words, signal=st.sampled_from(["ended", "aborted"])),
]  # fmt: skip
"""Behaviors without ids, and events without anchors. Made once: that takes longer than to draw one."""
option = st.builds(
    of.SpeechOption,
    text=words,
    cost=st.floats(0, 1e3),
    distractors=st.lists(words, max_size=2).map(tuple),
    deictic=st.booleans(),
)
references = st.builds(
    of.Reference,
    id=st.just(""),
    target=words,
    minimum_reliability=st.floats(0, 1, exclude_min=True, exclude_max=True),
    options=st.none() | st.lists(option, min_size=1, max_size=3).map(tuple),
)
in_blocks = st.one_of(KINDS)
in_fragments = st.one_of(*KINDS, references)


@st.composite
def behaviors(draw: st.DrawFn, id: str, reference: st.SearchStrategy[str], *, in_fragment: bool) -> of.Behavior:
    made = replace(draw(in_fragments if in_fragment else in_blocks), id=id)
    return replace(made, anchors=tuple(draw(st.lists(reference, max_size=2)))) if isinstance(made, of.Event) else made


times = st.builds(SyncRef, block=st.just("") | ids, offset=offsets)


@st.composite
def _inputs(draw: st.DrawFn, *, in_fragment: bool) -> tuple[tuple[of.Behavior, ...], tuple[of.Constraint, ...]]:
    names = draw(st.lists(ids, unique=True, max_size=4))
    points = st.sampled_from(("start", "end") if in_fragment else SYNC_POINTS)
    if names:
        named = st.builds(SyncRef, behavior=st.sampled_from(names), sync=points, offset=offsets)
        references = (times | named).map(str)
    else:
        references = times.map(str)
    syncs = st.lists(references, max_size=3).map(tuple)
    operators = st.one_of(
        st.builds(of.Synchronize, ref=st.just("") | references, syncs=syncs),
        st.builds(of.Before, ref=references, syncs=syncs),
        st.builds(of.After, ref=references, syncs=syncs),
    )
    made = []
    for name in names:
        behavior = draw(behaviors(name, references, in_fragment=in_fragment))
        known = [*SYNC_POINTS, "strokeStart", "m-1"]
        if in_fragment:  # of which the reader refuses what a behavior does not have
            known = (
                ["start", "end"] if isinstance(behavior, of.Speech | of.Reference) else [*SYNC_POINTS, "strokeStart"]
            )
        timed = draw(st.lists(st.sampled_from(known), unique=True, max_size=2))
        timing = tuple(of.Timing(sync, draw(references)) for sync in timed)
        made.append(replace(behavior, timing=timing, required=draw(st.booleans())))
    free = [id for id in draw(st.lists(ids, unique=True, max_size=2)) if id not in names]
    constraints = tuple(
        of.Constraint(
            id=id, operators=tuple(draw(st.lists(operators, max_size=3))), required=draw(st.booleans())
        )
        for id in ["", *free]
    )  # fmt: skip
    return tuple(made), constraints


@st.composite
def blocks(draw: st.DrawFn) -> Block:
    made, constraints = draw(_inputs(in_fragment=False))
    return Block(
        id=draw(ids),
        behaviors=made,  # type: ignore[arg-type]
        constraints=constraints,
        composition=draw(st.sampled_from(get_args(Composition))),
        dialect=draw(st.sampled_from(get_args(Dialect))),
        character_id=draw(words),
    )


people = st.just("") | st.just("*") | ids | st.lists(ids, min_size=2, max_size=3).map(tuple)


@st.composite
def fragments(draw: st.DrawFn) -> TurnFragment:
    made, constraints = draw(_inputs(in_fragment=True))
    return TurnFragment(
        id=draw(ids),
        turn_index=draw(st.sampled_from([1, 2, 3])),
        turn_status=draw(st.sampled_from(get_args(TurnStatus))),
        behaviors=made,  # type: ignore[arg-type]
        constraints=constraints,
        addressee=draw(people),
        interruptible=draw(st.none() | st.booleans() | people.filter(bool)),
        interruptible_after=draw(st.none() | st.floats(0.0, 10.0)),
        delay=draw(st.booleans()),
        delay_target=draw(words),
        accept=draw(actions),
        within=draw(st.none() | st.floats(0.1, 120.0)),
    )


def without_lines(thing: AnyInput) -> AnyInput:
    """Set every `line` to 0, as if the document had not come from XML."""
    if isinstance(thing, TurnFragment):
        thing = replace(thing, line=0)
    return replace(
        thing,
        behaviors=tuple(_behavior_without_lines(behavior) for behavior in thing.behaviors),
        constraints=tuple(
            of.Constraint(
                id=each.id,
                required=each.required,
                operators=tuple(replace(operator, line=0) for operator in each.operators),
            )
            for each in thing.constraints
        ),
    )


def _behavior_without_lines(behavior: AnyBehavior) -> AnyBehavior:
    behavior = replace(behavior, line=0)
    if isinstance(behavior, of.Reference) and behavior.options is not None:
        return replace(behavior, options=tuple(replace(option, line=0) for option in behavior.options))
    return behavior
