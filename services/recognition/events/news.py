"""What is remembered of what was observed, but not for ever: enough to know what is news."""

from typing import TypeVar

from engage_hri.schemas.actions import ActionBegan, ActionEnded
from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.units import Seconds
from engage_hri.services.recognition.events.presence import NEVER

Key = TypeVar("Key")
Value = TypeVar("Value")


class Latest(dict[Key, Value]):
    """Only the `size` entries that were set last are kept."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self._size = size

    def __setitem__(self, key: Key, value: Value) -> None:
        self.pop(key, None)
        super().__setitem__(key, value)
        if len(self) > self._size:
            del self[next(iter(self))]


class News:
    """When the actions of one actor last began and ended, for the `kept` latest of them."""

    def __init__(self, kept: int) -> None:
        self._performed: Latest[tuple[Action, str, tuple[str, ...]], tuple[Seconds, Seconds]] = Latest(kept)

    def is_news(self, action: ActionBegan | ActionEnded, at: Seconds) -> bool:
        """Did it neither come twice nor too late, after something newer of the same kind?"""
        key = (action.action, action.behavior, action.targets)
        began, ended = self._performed.get(key, (NEVER, NEVER))
        if isinstance(action, ActionBegan):
            news = at > began and at >= ended
            began = at if news else began
        else:
            news = at > ended and at >= began
            ended = at if news else ended
        self._performed[key] = (began, ended)
        return news
