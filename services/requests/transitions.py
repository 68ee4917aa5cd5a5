"""How a table of states and events is written down: each state has a row for each event. Pure."""

from collections.abc import Mapping
from enum import Enum
from typing import TypeVar


class Name(Enum):
    """Looked up with each message: by identity, at the speed of an object."""

    __hash__ = object.__hash__


StateT = TypeVar("StateT", bound=Name)
EventT = TypeVar("EventT", bound=Name)
DoT = TypeVar("DoT", bound=Name)


def rows(
    state: StateT, brief: Mapping[EventT, tuple[StateT, *tuple[DoT, ...]] | None]
) -> dict[EventT, tuple[StateT, tuple[DoT, ...]]]:
    """What `state` becomes with each event, and what follows. For brevity None stands for: it changes nothing."""
    whole: dict[EventT, tuple[StateT, tuple[DoT, ...]]] = {}
    for event, row in brief.items():
        after, *actions = row or (state,)
        whole[event] = (after, tuple(actions))
    return whole
