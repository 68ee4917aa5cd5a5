"""Bounded memory of observations, enough to tell new ones from repeated and late ones."""

from typing import TypeVar

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.units import Seconds
from engage_hri.services.recognition.events.presence import NEVER

Key = TypeVar("Key")
Value = TypeVar("Value")

NEVER_PERFORMED = (NEVER, NEVER)


class Latest(dict[Key, Value]):
    """A dict that keeps only the `size` entries that were set last."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self._size = size

    def __setitem__(self, key: Key, value: Value) -> None:
        self.pop(key, None)
        dict.__setitem__(self, key, value)
        if len(self) > self._size:
            del self[next(iter(self))]


class ActionHistory:
    """Times at which the actions of one actor last began and ended, for the `kept` latest of them."""

    def __init__(self, kept: int) -> None:
        self._performed: Latest[tuple[Action, str, tuple[str, ...]], tuple[Seconds, Seconds]] = Latest(kept)

    def is_new(self, action: ActionBegan | ActionEnded, at: Seconds) -> bool:
        """True unless the report repeats an earlier one, or comes after a newer report of the same action."""
        key = (action.action, action.behavior, action.targets)
        began, ended = self._performed.pop(key, NEVER_PERFORMED)
        if isinstance(action, ActionBegan):
            is_new = at > began and at >= ended
            began = at if is_new else began
        else:
            is_new = at > ended and at >= began
            ended = at if is_new else ended
        self._performed[key] = began, ended
        return is_new
