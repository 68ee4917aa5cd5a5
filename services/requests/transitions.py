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
    state: StateT, changes: Mapping[EventT, tuple[StateT, *tuple[DoT, ...]]], *ignored: EventT
) -> dict[EventT, tuple[StateT, tuple[DoT, ...]]]:
    """What `state` becomes with each event, and what follows. ignored: events that change nothing."""
    unchanged: dict[EventT, tuple[StateT, tuple[DoT, ...]]] = dict.fromkeys(ignored, (state, ()))
    return unchanged | {event: (after, tuple(actions)) for event, (after, *actions) in changes.items()}
