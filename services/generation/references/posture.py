"""Head and arms before each reference: on the target of the one before, or at rest (decision 0024). Pure."""

from collections.abc import Collection, Iterator, Mapping, Sequence

from msgspec import Struct

from engage_hri.schemas.behaviors import Constraint, FragmentBehavior, Reference, Speech, Wait
from engage_hri.schemas.fragments import GestureChoice
from engage_hri.schemas.references import BLOCK_ITSELF, SyncRef
from engage_hri.schemas.text import word_count
from engage_hri.services.generation.references.motions import AT_REST, CURRENT_POSE, Motions


class HeadAndArms(Struct, frozen=True):
    """Targets of the head and of each arm: that of a reference, the person glanced at, CURRENT_POSE or AT_REST."""

    head: str = CURRENT_POSE
    arms: tuple[tuple[str, str], ...] = ()
    """(arm, target) of the arms that have moved, by arm."""

    def arm(self, arm: str) -> str:
        for each, target in self.arms:
            if each == arm:
                return target
        return CURRENT_POSE

    def afterwards(self, target: str, arm: str, motions: Motions) -> Mapping[GestureChoice, "HeadAndArms"]:
        """The postures that the gestures at `target` leave: what one does not use goes home. arm: that points."""
        home = self.home_again(motions)
        looking = HeadAndArms(target, home.arms)
        moved = tuple(sorted([each for each in home.arms if each[0] != arm] + [(arm, target)]))
        pointing = HeadAndArms(motions.glance or target, moved)
        return {
            "none": home,
            "gaze": looking,
            "directed_gaze": looking,
            "directed_gaze_with_pointing": pointing,
        }

    def home_again(self, motions: Motions) -> "HeadAndArms":
        """The posture once all is over that a reference has moved. A glance lasts until the next look."""
        moved = self.head not in (CURRENT_POSE, motions.glance) and not motions.looks_last
        return HeadAndArms(AT_REST if moved else self.head, tuple([(arm, AT_REST) for arm, _ in self.arms]))


def references_apart(
    order: Sequence[FragmentBehavior], constraints: Sequence[Constraint], most_words: float
) -> frozenset[str]:
    """Ids of the references before which head and arms go home, since too much lies between (decision 0024).

    Too much are more than `most_words` words of plain speech, a `Wait`, or a clock time: how long that leaves an arm
    in the air nobody knows. order: of the fragment's behaviors.
    """
    apart = set(_by_the_clock(order, constraints))
    words, waits = 0.0, False
    for behavior in order:
        if isinstance(behavior, Reference):
            if waits or words > most_words:
                apart.add(behavior.id)
            words, waits = 0.0, False
        elif isinstance(behavior, Speech):
            words += word_count(behavior.text)
        elif isinstance(behavior, Wait):
            waits = True
    return frozenset(apart)


def _by_the_clock(order: Sequence[FragmentBehavior], constraints: Sequence[Constraint]) -> Iterator[str]:
    """Ids of the references that something ties to a clock time, or to another block."""
    references = {behavior.id for behavior in order if isinstance(behavior, Reference)}
    tied: list[Collection[str]] = [(f"{each.id}:start", timing.ref) for each in order for timing in each.timing]
    tied += [(operator.ref, *operator.syncs) for each in constraints for operator in each.operators]
    for texts in tied:
        refs = [SyncRef.parse(text) for text in texts if text]
        if any(ref.block or ref.behavior in ("", BLOCK_ITSELF) for ref in refs):
            yield from (ref.behavior for ref in refs if ref.behavior in references)
