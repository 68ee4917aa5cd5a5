"""Actions that people see the robot do, from the sync points its body reports and what its eyes rest on. Pure."""

from collections.abc import Mapping

from engage_hri.schemas.behaviors import Action, BlockBehavior, Head, Pointing, Speech
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.control.contract.body import Reached

ActionMessage = ActionBegan | ActionEnded
_HEADS: Mapping[str, Action] = {"NOD": "nod", "SHAKE": "shake"}
"""Heads that mean something as an action; others only turn or tilt."""


class ActionReporter:
    """Turns the progress of behaviors into actions of `actor`. Every action that began ends once."""

    def __init__(self, actor: str, clock: str) -> None:
        self._actor = actor
        self._clock = clock
        self._look: ActionBegan | None = None
        self._open: dict[str, ActionBegan] = {}

    def reached(self, id: str, label: str, behavior: BlockBehavior, reached: Reached) -> list[ActionMessage]:
        """List the actions that begin or end as request `id` passes a sync point. label: `block:behavior`."""
        action: Action
        targets: tuple[str, ...]
        match behavior:
            case Pointing(target=target):
                action, targets, first, last = "point", (target,), "stroke_start", "stroke_end"
            case Head(lexeme=lexeme) if (known := _HEADS.get(lexeme.upper())) is not None:
                action, targets, first, last = known, (), "stroke_start", "stroke_end"
            case Speech():
                action, targets, first, last = "speak", (), "start", "end"
            case _:
                return []
        if reached.sync == first:
            self._open[id] = began = self._began(action, targets, label, reached.at)
            return [began]
        return self.ended(id, reached.at) if reached.sync == last else []

    def ended(self, id: str, at: Seconds) -> list[ActionMessage]:
        """End the action of request `id`, if one is open. Call it however the request has ended."""
        return [self._end(began, at)] if (began := self._open.pop(id, None)) else []

    def looks_at(self, entity: str, label: str, at: Seconds) -> list[ActionMessage]:
        """List the looks that end and begin as the eyes come to rest on `entity`; empty: on nothing.

        label: `block:behavior` that brought the eyes there; empty: unknown.
        """
        if entity == (self._look.targets[0] if self._look else ""):
            return []
        messages: list[ActionMessage] = [self._end(self._look, at)] if self._look else []
        self._look = self._began("look", (entity,), label, at) if entity else None
        return [*messages, self._look] if self._look else messages

    def _began(self, action: Action, targets: tuple[str, ...], label: str, at: Seconds) -> ActionBegan:
        stamp = Stamp(self._clock, at)
        return ActionBegan(actor=self._actor, action=action, at=stamp, targets=targets, behavior=label)

    def _end(self, began: ActionBegan, at: Seconds) -> ActionEnded:
        return ActionEnded(
            actor=began.actor, action=began.action, at=Stamp(self._clock, at), targets=began.targets,
            behavior=began.behavior,
        )  # fmt: skip
