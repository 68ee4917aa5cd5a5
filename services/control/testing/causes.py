"""One cause that breaks many laws, told once: an error of the driver, a motor that never moves. Pure."""

from collections.abc import Iterable, Mapping, Sequence

from msgspec.structs import replace

from engage_hri.services.control.testing.report import Cause, CheckedLaw


def told_once(laws: Iterable[CheckedLaw], known: Sequence[Cause]) -> tuple[tuple[CheckedLaw, ...], tuple[Cause, ...]]:
    """Find what shows in several laws, and take these laws for not judged where nothing else is wrong.

    known: what the first look has found; it counts also where it shows in one law, or in none.
    """
    laws = tuple(laws)
    shown: dict[str, dict[str, None]] = {cause.what: {} for cause in known}
    for law in laws:
        for finding in law.findings:
            if finding.cause:
                shown.setdefault(finding.cause, {})[law.law] = None
    first = {cause.what: cause.behaviors for cause in known}
    causes = tuple(
        Cause(what=what, behaviors=first.get(what, ()), laws=tuple(names))
        for what, names in shown.items()
        if what in first or len(names) > 1
    )
    shared = {cause.what for cause in causes}
    return tuple(_judged(law, shared) for law in laws), causes


def _judged(law: CheckedLaw, shared: set[str]) -> CheckedLaw:
    own = [finding for finding in law.findings if finding.cause not in shared]
    return replace(law, verdict="not judged") if law.findings and not own else law


def by_words(outcomes: Mapping[str, str]) -> tuple[Cause, ...]:
    """Put together behaviors of which the same is true.

    outcomes: what went wrong with each behavior, both in words.
    """
    found: dict[str, list[str]] = {}
    for behavior, what in outcomes.items():
        found.setdefault(what, []).append(behavior)
    return tuple(Cause(what=what, behaviors=tuple(behaviors)) for what, behaviors in found.items())
