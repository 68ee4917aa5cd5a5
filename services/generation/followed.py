"""Lists of policies: ours in their order, those of installed packages in their places, and who asks them. Pure.

A policy is a reason to do something by oneself, without an order of the manager. It knows nothing of the others, and
its list asks all of them. What is strongest, who is asked first, and which number a claim has are counted from the
order.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import Any, ClassVar, Generic, Protocol, TypeVar

from engage_hri.schemas.advice import suggestion
from engage_hri.schemas.faults import Fault, InputRefused


class Policy(Protocol):
    """Properties of any policy. before: name of the one before which one of others comes. name: its own."""

    before: ClassVar[str]
    name: str


Kind = TypeVar("Kind", bound=Policy)
Answer = TypeVar("Answer")


def arranged(
    own: Mapping[str, type[Kind]], others: Mapping[str, type[Kind]], off: Collection[str] = ()
) -> dict[str, type[Kind]]:
    """The policies to follow by their names, the strongest first.

    own: ours in their order. others: of installed packages; one with a name of ours replaces ours. off: names of
    those not to follow. Raises InputRefused: a policy comes before one that there is not.
    """
    order = [*own]
    for name, policy in others.items():
        if name in order:
            continue
        if policy.before not in order:
            reason = f"policy {name!r} is to come before {policy.before!r}, and there is none"
            raise unknown(reason, policy.before, order, name)
        order.insert(order.index(policy.before), name)
    known = {**own, **others}
    return {name: known[name] for name in order if name not in off}


def unknown(reason: str, name: str, names: Collection[str], where: str) -> InputRefused:
    """Refusal of a name that no policy has. names: those there are."""
    advice = suggestion(name, names) or f"one of {', '.join(names)}"
    return InputRefused(Fault(reason=reason, where=where, advice=advice))


def checked(name: str, answer: Answer, kind: Any) -> Answer:
    """Return what a policy answers. kind: what it has to be. Raises TypeError, within the question: it is no such."""
    if not isinstance(answer, kind):
        hint = "; is @property missing?" if callable(answer) else ""
        raise TypeError(f"its {name} is of type {type(answer).__name__}, and not {kind}{hint}")
    return answer


class Followed(Generic[Kind]):
    """Policies that are followed, the strongest first. One of others that raises is so no longer."""

    def __init__(self, policies: Iterable[Kind]) -> None:
        self._policies = [*policies]
        self.mistakes: list[tuple[str, Exception]] = []
        """Policies that have raised, and what, until somebody takes them."""

    def __iter__(self) -> Iterator[Kind]:
        return iter(self._policies)

    def ask(self, question: Callable[[Kind], Answer]) -> list[Answer]:
        """Ask all, the weakest first, or tell them. A mistake of ours is raised, one of others is noted."""
        answers = []
        for policy in self._policies[::-1]:
            try:
                answers.append(question(policy))
            except Exception as error:
                self._drop(policy, error)
        return answers

    def first(self, question: Callable[[Kind], Answer | None]) -> Answer | None:
        """Ask one after the other, the strongest first, until one has an answer."""
        for policy in [*self._policies]:
            try:
                if answer := question(policy):
                    return answer
            except Exception as error:
                self._drop(policy, error)
        return None

    def _drop(self, policy: Kind, error: Exception) -> None:
        if type(policy).__module__.startswith("engage_hri."):
            raise error
        self._policies.remove(policy)
        self.mistakes.append((policy.name, error))
