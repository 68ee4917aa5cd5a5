"""Behaviors that mean nothing without others, and fall with these (`Behavior.needs`)."""

from collections.abc import Container, Iterable, Mapping

from engage_hri.schemas.behaviors import Event
from engage_hri.schemas.blocks import Block
from engage_hri.services.realizer.plan.phases import Chain


def without(needed: str) -> str:
    """Reason why a behavior is dropped that needs another one. needed: id of that."""
    return f"it needs {needed}, which is not performed"


def falling(chains: Mapping[str, Chain], lost: Iterable[str], begun: Container[str]) -> dict[str, str]:
    """Behaviors that fall because others are lost, each with the one that it needs. What has begun is finished."""
    needing: dict[str, list[str]] = {}
    for id, chain in chains.items():
        for needed in chain.behavior.needs if id not in begun else ():
            needing.setdefault(needed, []).append(id)
    found: dict[str, str] = {}
    todo = list(lost) if needing else []
    for needed in todo:  # it grows
        fresh = [id for id in needing.get(needed, ()) if id not in found]
        found |= dict.fromkeys(fresh, needed)
        todo += fresh
    return found


def events_needing(lost: str, block: Block) -> list[Event]:
    """Connection events of the block that need a behavior: they are withdrawn with it, even if they have begun."""
    return [each for each in block.behaviors if isinstance(each, Event) and lost in each.needs]
