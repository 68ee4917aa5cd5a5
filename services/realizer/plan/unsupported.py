"""Warnings about what is not performed: behaviors that nobody here knows, or that the body refuses."""

from typing import get_args

from msgspec.structs import replace

from engage_hri.schemas.behaviors import Unknown
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.feedback import WarningKind
from engage_hri.schemas.vocabulary import unperformed


def unknown(behavior: Unknown) -> tuple[WarningKind, str]:
    """Kind and reason of the warning about a behavior that nobody here knows, or that does not say what to do."""
    if behavior.namespace:
        return "CUSTOM_BEHAVIOR_NOT_SUPPORTED", f"<{behavior.element}> is of namespace {behavior.namespace!r}"
    if behavior.lacks:
        return (
            "CANNOT_CREATE_BEHAVIOR",
            f"<{behavior.element}> has no {behavior.lacks}, so there is nothing to perform",
        )
    return "BEHAVIOR_TYPE_NOT_SUPPORTED", unperformed(behavior.element)


def kind_of(warning: str) -> WarningKind:
    """Kind of the warning that a body gives as the reason why it cannot do a behavior."""
    return warning if warning in get_args(WarningKind) else "CANNOT_CREATE_BEHAVIOR"  # type: ignore[return-value]


def refused(estimate: Estimate, block: str) -> tuple[WarningKind, str, str]:
    """Kind, reason and advice of the warning about a behavior that the body cannot do."""
    fault = estimate.fault or Fault(reason="the body cannot do it")
    return kind_of(estimate.warning), replace(fault, advice="").within(block, estimate.behavior), fault.advice
