"""What goes on after events, found anew each time: the slow way, to compare with."""

from collections.abc import Sequence

from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost


def going_on(events: Sequence[Message], actor: str) -> tuple[ActionBegan, ...]:
    """The beginnings of this actor after which nothing has ended or replaced them, in order."""
    own = [each for each in events if isinstance(each, ActionBegan | ActionEnded) and each.actor == actor]
    return tuple(
        one
        for at, one in enumerate(own)
        if isinstance(one, ActionBegan) and not any(_ends(one, x) for x in own[at + 1 :])
    )


def _ends(one: ActionBegan, later: ActionBegan | ActionEnded) -> bool:
    if one.action != later.action:
        return False
    if isinstance(later, ActionBegan):
        return one.action == "look" or (one.targets, one.behavior) == (later.targets, later.behavior)
    return later.targets in ((), one.targets) and (one.action == "look" or later.behavior == one.behavior)


def is_seen(events: Sequence[Message], actor: str) -> bool | None:
    """Whether this actor was found last, or lost; None: neither."""
    told = [each for each in events if isinstance(each, ActorFound | ActorLost) and each.actor == actor]
    return isinstance(told[-1], ActorFound) if told else None
