"""References that cannot be made any more: their words are said, and nothing else of the fragment is lost. Pure.

Between the writing of a fragment and its performance an object may leave, and a model may name what never was there.
A speaker says the words all the same. Only a document of which nothing at all could be performed is refused; a piece
of a turn never is, for that would cost the rest of the turn.
"""

from msgspec.structs import replace

from engage_hri.schemas.behaviors import FragmentBehavior, Reference, Speech
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.world import World
from engage_hri.services.generation.references.phrases import noun_in
from engage_hri.services.text.ear import heard, is_spoken


def bearable(fragment: TurnFragment, world: World) -> tuple[TurnFragment, tuple[str, ...]]:
    """The fragment with words in place of each reference to what is no object of the world, and warnings of them.

    Phrases that have no words, such as an emoji alone, are left out, too: they name nothing.
    """
    objects = {each.id for each in world.objects}
    lost = {each.id for each in fragment.behaviors if isinstance(each, Reference) and each.target not in objects}
    is_piece = fragment.turn_status in ("beginning", "middle", "end")
    if lost and not is_piece and not any(_is_performed(each) for each in fragment.behaviors if each.id not in lost):
        lost = set()  # it is refused
    warnings: list[str] = []
    behaviors: list[FragmentBehavior] = []
    for each in fragment.behaviors:
        if isinstance(each, Reference):
            each = _with_words(each, warnings)
            if each.id in lost:
                each = _as_speech(each, warnings)
        behaviors.append(each)
    return (replace(fragment, behaviors=tuple(behaviors)) if warnings else fragment), tuple(warnings)


def unsaid(fragment: TurnFragment) -> tuple[str, ...]:
    """Say what of a fragment's words is for the eye alone, and so is not said."""
    speeches = [each for each in fragment.behaviors if isinstance(each, Speech)]
    return tuple(f"{each.id}: {problem}" for each in speeches for problem in heard(each.text).problems)


def _is_performed(behavior: FragmentBehavior) -> bool:
    return is_spoken(behavior.text) if isinstance(behavior, Speech) else True


def _with_words(reference: Reference, warnings: list[str]) -> Reference:
    options = reference.options or ()
    silent = [each for each in options if each.text.strip() and not is_spoken(each.text)]
    if not silent:
        return reference
    warnings.append(f"{reference.id}: no words in {', '.join(repr(each.text) for each in silent)}")
    kept = tuple(each for each in options if each not in silent)
    return replace(reference, options=kept or None)


def _as_speech(reference: Reference, warnings: list[str]) -> Speech:
    text = next((each.text for each in reference.options or () if is_spoken(each.text)), noun_in(reference.target))
    how = f"only said: {text!r}" if text else "left out"
    warnings.append(f"{reference.id}: the world does not know the object {reference.target!r}; {how}")
    return Speech(id=reference.id, text=text, timing=reference.timing, line=reference.line)
