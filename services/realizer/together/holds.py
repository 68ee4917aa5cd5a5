"""Holds that are in force: on the whole robot, on blocks, on behaviors."""

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.points import EPSILON, frozen

Named = tuple[str, str]
"""A block and a behavior of it. An empty behavior: the whole block; an empty block: the robot."""


class Holds:
    """Holds by what they hold, each with the time since when."""

    def __init__(self) -> None:
        self._since: dict[Named, Seconds] = {}

    def hold(self, block: str, behavior: str, now: Seconds) -> None:
        """Hold it from now on, if it is not held already."""
        self._since.setdefault((block, behavior), now)

    def let_go(self, block: str, behavior: str) -> None:
        """Let go what this names, and all that is part of it."""
        for held in [each for each in self._since if _is_part(each, (block, behavior))]:
            del self._since[held]

    def of_block(self, block: str) -> frozenset[str] | None:
        """Behaviors of the block that are held; None: all."""
        if ("", "") in self._since or (block, "") in self._since:
            return None
        return frozen(behavior for name, behavior in self._since if name == block)

    @property
    def in_force(self) -> list[tuple[Named, Seconds]]:
        """All holds, each with the time since when, the oldest first."""
        return sorted(self._since.items(), key=lambda each: each[1])

    def around(self, block: str, behavior: str) -> Named | None:
        """The smallest of what is held of which this is a part: it goes on only when that does. None: nothing."""
        named = (block, behavior)
        wholes = [held for held in self._since if held != named and _is_part(named, held)]
        return max(wholes, default=None)

    def earliest(self) -> Seconds | None:
        """Time since when something is held, the longest; None: nothing is."""
        return min(self._since.values(), default=None)

    def expired(self, now: Seconds, longest: Seconds) -> list[Named]:
        """Holds that have been in force for so long: those whose time, begun plus longest, has come."""
        return [held for held, since in self._since.items() if since + longest <= now + EPSILON]


def _is_part(one: Named, whole: Named) -> bool:
    block, behavior = whole
    return not block or (one[0] == block and (not behavior or one[1] == behavior))
