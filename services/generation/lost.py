"""Words in place of what a fragment names and the world does not know; nothing else of it is lost. Pure.

Between the writing of a fragment and its performance an object may leave, and a model may name what never was there.
A speaker says the words all the same. Only a fragment of which nothing at all could be performed is refused; a piece
of a turn never is, for that would cost the rest of the turn.
"""

from collections.abc import Set
from string import ascii_letters, digits

from msgspec.structs import replace

from engage_hri.schemas.advice import meant
from engage_hri.schemas.behaviors import FragmentBehavior, Reference, Speech, Wait
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.references import rewritten
from engage_hri.schemas.world import World
from engage_hri.services.generation.names import Aimed, Ids, Kind, known, spelled, unknown
from engage_hri.services.generation.references.phrases import noun_in
from engage_hri.services.text.ear import heard, is_spoken

_NAME = f"{ascii_letters}{digits}_"
"""Characters of the name of a sync point; an offset may follow it."""


def bearable(fragment: TurnFragment, world: World, robot: str) -> tuple[TurnFragment, tuple[str, ...]]:
    """The fragment without what the world does not know, with words in place of references to it, and warnings.

    Ids are spelled as the world spells them. Phrases that have no words, such as an emoji alone, are left out, too:
    they name nothing.
    """
    ids = known(world, robot)
    fragment, told = spelled(fragment, ids)
    warnings = list(told)
    behaviors = [_bearable(each, ids, warnings) for each in fragment.behaviors]
    is_piece = fragment.turn_status in ("beginning", "middle", "end")
    pairs = zip(fragment.behaviors, behaviors, strict=True)
    if not is_piece and not any(_is_performed(after) for before, after in pairs if type(after) is type(before)):
        return fragment, told  # what it names is refused, if that is wrong
    delay = fragment.delay_target
    if delay and delay not in ids["entity"]:
        warnings.append(f"{_unknown(delay, 'entity', ids)}; the robot looks elsewhere while it is silent")
        delay = ""
    left_out = {each.id for each in set(behaviors) - set(fragment.behaviors) if isinstance(each, Wait)}
    changed = replace(fragment, behaviors=tuple(behaviors), delay_target=delay)
    return _retied(changed, left_out) if left_out else changed, tuple(warnings)


def left_unsaid(fragment: TurnFragment) -> tuple[str, ...]:
    """Say what of a fragment's words is for the eye alone, and so is not said."""
    speeches = [each for each in fragment.behaviors if isinstance(each, Speech)]
    return tuple(f"{each.id}: {problem}" for each in speeches for problem in heard(each.text).problems)


def _is_performed(behavior: FragmentBehavior) -> bool:
    return is_spoken(behavior.text) if isinstance(behavior, Speech) else True


def _bearable(behavior: FragmentBehavior, ids: Ids, warnings: list[str]) -> FragmentBehavior:
    """The behavior, or what is done in its place; a wait takes no time, but others may be tied to it."""
    if isinstance(behavior, Reference):
        behavior = _with_words(behavior, ids, warnings)
        return behavior if behavior.target in ids["object"] else _as_speech(behavior, ids, warnings)
    if isinstance(behavior, Aimed) and behavior.target not in ids["entity"]:
        warnings.append(f"{behavior.id}: {_unknown(behavior.target, 'entity', ids)}; left out")
        begins = tuple(each for each in behavior.timing if each.sync == "start")
        return Wait(id=behavior.id, duration=0.0, timing=begins, line=behavior.line)
    return behavior


def _with_words(reference: Reference, ids: Ids, warnings: list[str]) -> Reference:
    """The reference with phrases that have words, to be told apart from objects that there are."""
    kept = []
    for each in reference.options or ():
        if each.text.strip() and not is_spoken(each.text):
            warnings.append(f"{reference.id}: no words in {each.text!r}")
            continue
        if gone := [id for id in each.distractors if id not in ids["object"]]:
            told = "; ".join(_unknown(id, "object", ids) for id in gone)
            warnings.append(f"{reference.id}: {told}; not taken for another one")
            each = replace(each, distractors=tuple(id for id in each.distractors if id in ids["object"]))
        kept.append(each)
    return reference if tuple(kept) == (reference.options or ()) else replace(reference, options=tuple(kept) or None)


def _as_speech(reference: Reference, ids: Ids, warnings: list[str]) -> Speech:
    text = next((each.text for each in reference.options or () if is_spoken(each.text)), noun_in(reference.target))
    how = f"only said: {text!r}" if text else "left out"
    warnings.append(f"{reference.id}: {_unknown(reference.target, 'object', ids)}; {how}")
    return Speech(id=reference.id, text=text, timing=reference.timing, line=reference.line)


def _retied(fragment: TurnFragment, gone: Set[str]) -> TurnFragment:
    """The fragment tied to the start of what is left out where it was tied to another point of that."""

    def to_start(ref: str) -> str:
        id, _, rest = ref.partition(":")
        return f"{id}:start{rest.lstrip(_NAME)}" if id in gone else ref

    return rewritten(fragment, to_start)


def _unknown(id: str, kind: Kind, ids: Ids) -> str:
    return f"{unknown(id, kind, ids)}{'' if id in ids['entity'] else meant(id, ids[kind])}"
