"""Settings under which the services of a recording ran: those of each life, and a file of configuration. Pure."""

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.participants import ServiceSettings, sections
from engage_hri.schemas.units import Seconds
from engage_hri.services.recording.reading import Recording

_BARE = re.compile(r"[A-Za-z0-9_-]+")
COLUMNS = ("participant", "life", "from", "key", "value")


class LifeSettings(Struct, frozen=True, kw_only=True):
    """Settings of one life of a service. since: time at which the recording has them; 0.0: it ran before.

    number: 1 for the first life of this service in the recording. sections: what `told` has as text.
    unread: why nobody can read that, and there are no sections; empty: they were read.
    """

    told: ServiceSettings
    since: Seconds
    number: int
    sections: dict[str, Any]
    unread: str = ""

    @property
    def values(self) -> dict[str, str]:
        """Each value by the name of its setting, as `section.key=value` has both."""
        return dict(flat(self.sections))


def settings_of(recording: Recording) -> list[LifeSettings]:
    """Find the settings of all lives, in the order in which they came."""
    found: dict[tuple[str, str], LifeSettings] = {}
    numbers: dict[str, int] = {}
    for number in range(len(recording)):
        key = recording.key(number)
        if not key or not keys.matches(keys.ANY_SETTINGS, key):
            continue
        received = recording.received(number)
        told = received.message if received else None
        if received is None or not isinstance(told, ServiceSettings) or (told.participant, told.run) in found:
            continue
        numbers[told.participant] = numbers.get(told.participant, 0) + 1
        since = 0.0 if received.past else recording.time(number)
        found[told.participant, told.run] = _life(told, since, numbers[told.participant])
    return list(found.values())


def _life(told: ServiceSettings, since: Seconds, number: int) -> LifeSettings:
    try:
        return LifeSettings(told=told, since=since, number=number, sections=sections(told.settings))
    except InputRefused as refused:  # of another program, or damaged: the rest of the recording is read
        return LifeSettings(told=told, since=since, number=number, sections={}, unread=refused.fault.reason)


def flat(settings: Mapping[str, Any], place: str = "") -> Iterator[tuple[str, str]]:
    """Name and value of each setting, the value in TOML; empty for none."""
    for name, value in settings.items():
        key = f"{place}{_key(name)}"
        if isinstance(value, dict) and value:
            yield from flat(value, f"{key}.")
        else:
            yield key, _value(value)


def changed(life: LifeSettings, others: Mapping[str, str]) -> list[str]:
    """Settings of a life that are not as in others, each as `key = value`."""
    return [f"{key} = {value or 'none'}" for key, value in life.values.items() if others.get(key) != value]


def rows(all_lives: Iterable[LifeSettings]) -> Iterator[tuple[str, int, float, str, str]]:
    """Participant, number of its life, time from which on, setting and value: all there are."""
    for life in all_lives:
        for key, value in life.values.items():
            yield life.told.participant, life.number, round(life.since, 6), key, value


def configuration(all_lives: Sequence[LifeSettings], name: str) -> str:
    """A file of configuration with the settings of the last life of each service; the others as comments.

    name: of the recording.
    """
    last = {life.told.participant: life for life in all_lives}
    versions = sorted({life.told.version for life in all_lives})
    lines = [*_comment(f"Settings of {name}, of Engage {', '.join(versions)}.")]
    for life in all_lives:
        if life.unread:
            lines += _comment(f"{life.told.participant}, life {life.number}: not read: {life.unread}")
        now = last[life.told.participant]
        for line in changed(life, now.values) if life is not now else ():
            lines += _comment(f"{life.told.participant}, life {life.number}, from {life.since:.3f} s: {line}")
    values: dict[str, Any] = {}
    for life in last.values():
        values |= life.sections
    lines += ["", *_table(values, ())]
    for life in all_lives:
        for file in life.told.files:
            lines += [
                "",
                *_comment(f"{life.told.participant}, life {life.number}: the file {file.name} was"),
                *_comment(file.text),
            ]
    return "\n".join(lines) + "\n"


def _comment(text: str) -> list[str]:
    """Lines of a comment. TOML has no control characters there."""
    clean = (re.sub(r"[\x00-\x08\x0a-\x1f\x7f]", " ", line) for line in text.splitlines() or [""])
    return [f"# {line}".rstrip() for line in clean]


def _table(values: Mapping[str, Any], place: tuple[str, ...]) -> Iterator[str]:
    tables = {name: value for name, value in values.items() if isinstance(value, dict)}
    for name, value in values.items():
        if value is None:
            yield from _comment(f"{_key(name)} is none")
        elif name not in tables:
            yield f"{_key(name)} = {_value(value)}"
    for name, table in tables.items():
        inner = (*place, _key(name))
        yield ""
        yield f"[{'.'.join(inner)}]"
        yield from _table(table, inner)


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else _text(name)


def _value(value: Any) -> str:
    """A value in TOML; empty for none, which it does not have."""
    match value:
        case None:
            return ""
        case bool():
            return str(value).lower()
        case float() if not math.isfinite(value):
            return str(value)
        case int() | float():
            return repr(value)
        case list() | tuple():
            return f"[{', '.join(_value(one) for one in value if one is not None)}]"
        case dict():
            inner = (f"{_key(name)} = {_value(one)}" for name, one in value.items() if one is not None)
            return f"{{{', '.join(inner)}}}"
    return _text(value.decode(errors="replace") if isinstance(value, bytes) else str(value))


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
