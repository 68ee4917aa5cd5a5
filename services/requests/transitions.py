"""Helpers to write a table of states and events, with a row for each event in each state. Pure."""

from collections.abc import Mapping
from enum import Enum
from typing import TypeVar


class TableMember(Enum):
    """Member of a table. It is looked up with each message, so it hashes as any object does: faster than an enum."""

    __hash__ = object.__hash__


StateT = TypeVar("StateT", bound=TableMember)
EventT = TypeVar("EventT", bound=TableMember)
DoT = TypeVar("DoT", bound=TableMember)


def rows(
    state: StateT, changes: Mapping[EventT, tuple[StateT, *tuple[DoT, ...]]], *ignored: EventT
) -> dict[EventT, tuple[StateT, tuple[DoT, ...]]]:
    """The rows of `state`: for each event the state after it, and what to do. ignored: events that change nothing."""
    unchanged: dict[EventT, tuple[StateT, tuple[DoT, ...]]] = dict.fromkeys(ignored, (state, ()))
    return unchanged | {event: (after, tuple(actions)) for event, (after, *actions) in changes.items()}
