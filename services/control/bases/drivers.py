"""Drivers by name: the classes that make bodies, of this package, of another one, or of a file.

    body = made(config)             # of `control.body`, `control.voice` and `control.drivers`, inside the event loop

A name is one that an installed package offers (`services/runtime/offers.py`), ours among them;
`package.module:Class`, which may lie in the current folder; or `FILE.py:Class`. `head,face=NAME` takes only these
parts of a driver.
"""

import inspect
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from functools import partial
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.advice import explained
from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.services.control.bases.composed import Member, composed
from engage_hri.services.control.bases.driver_guard import GuardedBody, seen_at, words_of
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.body import Body
from engage_hri.services.runtime.installation import BODIES, VOICES, Offer, offers, packages_command, unreadable

FORMS = "NAME, FILE.py:CLASS or package.module:CLASS"
_OWN = __name__.partition(".")[0]
Driver = Callable[..., Body]


class Named(Struct, frozen=True):
    """A driver as it was asked for, as a body or as the voice.

    spec: its name. parts: the only ones that it is to have; empty: all it has.
    """

    spec: str
    parts: tuple[str, ...] = ()
    is_voice: bool = False

    @property
    def name(self) -> str:
        """Name of the table with its settings, `control.drivers.NAME`: what stands behind the last colon."""
        return self.spec.rpartition(":")[2].removesuffix(".py") if ":" in self.spec else Path(self.spec).stem


def named(text: str) -> Named:
    """Read `simulated`, `mine.py:Head` or `head,face=mine.py:Head`. Raises InputRefused."""
    before, equals, spec = text.rpartition("=")
    parts = tuple(part.strip() for part in before.split(",")) if equals else ()
    if not spec.strip() or not all(parts):
        raise _refusal(f"{text!r} names no body", text, f"{FORMS}; for some of its parts only: head,face=NAME")
    return Named(spec.strip(), parts)


def made(config: ControlConfig, *, is_guarded: bool = True) -> Body:
    """Make the body that the configuration asks for, of one driver or of several. Raises InputRefused.

    is_guarded: what others' drivers raise becomes faults that name them (`GuardedBody`).
    """
    members = []
    for each in _asked(config):
        with _called(each):
            body = make(each, config)
            if is_guarded and not type(body).__module__.startswith(f"{_OWN}."):
                body = GuardedBody(each.spec, body)
            members.append(Member(each.spec, body, _parts(each, body, own_voice=not config.voice)))
    return composed(members)


def check(config: ControlConfig) -> None:
    """Refuse drivers that cannot be had, without making a body. Raises InputRefused."""
    for each in _asked(config):
        if each.spec != "simulated":
            with _called(each):
                _settings(each, load(each.spec, is_voice=each.is_voice), config)


def with_settings_of_drivers(config: ControlConfig) -> ControlConfig:
    """The configuration with all settings of each driver that is asked for, those at their defaults too."""
    found = {}
    for each in _asked(config):
        driver = load(each.spec, is_voice=each.is_voice)
        settings = _settings(each, driver, config)
        if settings is not None:
            where = _given(each, driver, config)[1]
            found[where.rpartition(".")[2]] = msgspec.structs.asdict(settings)
    return replace(config, drivers={**config.drivers, **found})


def _asked(config: ControlConfig) -> list[Named]:
    voice = [Named(config.voice, ("voice",), is_voice=True)] if config.voice else []
    return [*map(named, config.bodies), *voice]


def make(asked: Named, config: ControlConfig) -> Body:
    """Make the body of one driver, with its settings. Raises InputRefused if it breaks, or is no body."""
    driver = load(asked.spec, is_voice=asked.is_voice)
    settings = _settings(asked, driver, config)
    try:
        is_class = _is_configured(driver)
        make_it: Any = partial(driver.configured, config, settings) if is_class else driver  # type: ignore[attr-defined]
        body = make_it() if is_class or settings is None else make_it(settings)
    except EngageError:
        raise
    except Exception as error:
        raise _refusal(f"its driver breaks as it is made: {words_of(error)}", asked.spec, seen_at(error)) from error
    if not isinstance(body, Body):
        advice = "it is to be a class that inherits from `engage_hri.Body`, or a function that returns one"
        raise _refusal(f"it makes a {type(body).__name__}, and no body", asked.spec, advice)
    if not isinstance(getattr(body, "capabilities", None), msgspec.Struct):
        raise _refusal("its body has no `capabilities`", asked.spec, "set `self.capabilities = Capabilities(...)`")
    return body


def _is_configured(driver: Driver) -> bool:
    """True for a class of a body whose `configured` knows how it is made: no class below has another `__init__`."""
    if not (inspect.isclass(driver) and issubclass(driver, Body)):
        return False
    owner = {name: next(one for one in driver.__mro__ if name in vars(one)) for name in ("configured", "__init__")}
    return owner["configured"] is Body or issubclass(owner["configured"], owner["__init__"])


def load(spec: str, *, is_voice: bool = False) -> Driver:
    """Import a driver by its name. is_voice: only voices are offered for a wrong one. Raises InputRefused."""
    where, colon, name = spec.rpartition(":")
    if (file := where if colon else spec).endswith(".py"):
        module = _file(Path(file), spec)
        return _attribute(module, name, spec) if colon else _only(module, spec)
    if colon:
        _find_beside(Path.cwd())
        return _attribute(_imported(where, spec), name, spec)
    return _offered(spec, is_voice=is_voice)


def _offered(spec: str, *, is_voice: bool) -> Driver:
    """Import the driver that an installed package offers under a name. Raises InputRefused."""
    groups = (VOICES, BODIES) if is_voice else (BODIES, VOICES)
    found = next(filter(None, ([each for each in offers(group) if each.name == spec] for group in groups)), [])
    if not found:
        raise _unknown(spec, [each.name for group in groups[: 1 if is_voice else 2] for each in offers(group)])
    if len(found) > 1:
        them = " and ".join(_package(each) for each in found)
        raise _refusal(
            f"two packages offer it: {them}", spec, "uninstall one, or name the class: package.module:CLASS"
        )
    (offer,) = found
    try:
        return offer.load()  # type: ignore[no-any-return]
    except (Exception, SystemExit) as error:
        whose = "it" if offer.is_ours else f"the driver of the package {_package(offer)}"
        reason = f"{whose} cannot be imported: {words_of(error)}"
        raise _refusal(reason, spec, offer.advice(error) or seen_at(error)) from error


def _package(offer: Offer) -> str:
    return f"{offer.package} {offer.version} ({offer.value})"


def _unknown(spec: str, offered: Sequence[str]) -> InputRefused:
    """Refuse a name that nobody offers, with the names that somebody does."""
    known = sorted(set(offered))
    if not known:  # not even our own: the source is newer than what is installed
        return _refusal(f"no body {spec!r}", spec, f"install Engage once more: {packages_command('-e', '.')}")
    close = get_close_matches(spec, known, n=1)
    advice = f"do you mean {close[0]}? " if close else ""
    advice += f"known are {', '.join(known)}; or {FORMS}"
    if bad := unreadable():
        advice += f"; the entry points of the package {', '.join(bad)} cannot be read"
    return _refusal(f"no body {spec!r}", spec, advice)


# -- parts and settings -------------------------------------------------------------------------------------------


def _parts(asked: Named, body: Body, *, own_voice: bool) -> tuple[str, ...]:
    has = body.capabilities.parts
    if unknown := [part for part in asked.parts if part not in has]:
        raise _refusal(f"it has no part {', '.join(unknown)}", asked.spec, f"it has {', '.join(has) or 'none'}")
    return asked.parts or tuple(part for part in has if own_voice or part != "voice")


def _settings(asked: Named, driver: Driver, config: ControlConfig) -> Struct | None:
    kind = getattr(driver, "Settings", None)
    given, where = _given(asked, driver, config)
    if kind is None:
        if given:
            raise _refusal(f"this driver has no settings, and {', '.join(given)} are given", where, "leave them out")
        return None
    if unknown := sorted(set(given) - set(kind.__struct_fields__)):
        reason = f"no setting {', '.join(unknown)}"
        raise _refusal(reason, where, f"known are {', '.join(kind.__struct_fields__) or 'none'}")
    try:
        return msgspec.convert(given, kind)  # type: ignore[no-any-return]
    except msgspec.ValidationError as error:
        reason, key = explained(error, kind)
        raise _refusal(reason, f"{where}.{key}".rstrip("."), "") from error


def _given(asked: Named, driver: Driver, config: ControlConfig) -> tuple[Mapping[str, Any], str]:
    """The settings of a driver, and where they stand: by the name of its class, or of the file or entry point."""
    names = dict.fromkeys((getattr(driver, "__name__", asked.name), asked.name))
    found = next((name for name in names if name in config.drivers), None)
    if found is None and config.drivers:
        known = _known(config)
        rest = [name for name in config.drivers if name not in known]
        for name in names:
            if close := get_close_matches(name, rest, n=1, cutoff=0.7):
                raise _refusal(
                    "no driver of this name is asked for", f"control.drivers.{close[0]}", f"do you mean {name}?"
                )
    return config.drivers.get(found or "", {}), f"control.drivers.{found or asked.name}"


def _known(config: ControlConfig) -> set[str]:
    """Names that settings may have."""
    return {*(each.name for each in _asked(config)), *(each.name for each in (*offers(BODIES), *offers(VOICES)))}


# -- imports ------------------------------------------------------------------------------------------------------


def _imported(module: str, spec: str) -> ModuleType:
    try:
        return import_module(module)
    except Exception as error:
        advice = seen_at(error)
        if isinstance(error, ModuleNotFoundError):
            missing = error.name or ""
            if missing and f"{module}.".startswith(f"{missing}."):
                advice = f"is the package installed here? Of a file: {FORMS.partition(', ')[2]}"
        raise _refusal(f"it cannot be imported: {words_of(error)}", spec, advice) from error


def _file(path: Path, spec: str) -> ModuleType:
    """Run a file as a module; what lies beside it can be imported, as of a script."""
    if not path.is_file():
        raise _refusal(
            f"no file {path}", spec, f"a relative path counts from the folder of the process, {Path.cwd()}"
        )
    name = f"engage_hri_body_{path.stem}"
    if (loaded := sys.modules.get(name)) is not None and loaded.__file__ == str(path.resolve()):
        return loaded
    plan = spec_from_file_location(name, path.resolve())
    assert plan is not None
    assert plan.loader is not None
    module = module_from_spec(plan)
    _find_beside(path.resolve().parent)
    sys.modules[name] = module
    try:
        plan.loader.exec_module(module)
    except BaseException as error:
        del sys.modules[name]
        if not isinstance(error, Exception | SystemExit):
            raise
        raise _refusal(f"it cannot be imported: {words_of(error)}", spec, seen_at(error)) from error
    return module


def _find_beside(folder: Path) -> None:
    """Let what lies in a folder be imported, after all that is installed."""
    if str(folder) not in sys.path:
        sys.path.append(str(folder))


def _attribute(module: ModuleType, name: str, spec: str) -> Driver:
    found: Any = module
    for step in name.split("."):
        found = getattr(found, step, None)
    if not callable(found):
        offered = _bodies(module)
        close = get_close_matches(name, offered, n=1)
        advice = f"do you mean {close[0]}?" if close else f"it has {', '.join(offered) or 'no class of a body'}"
        reason = f"no class {name!r} in it" if found is None else f"{name!r} in it is no class"
        raise _refusal(reason, spec, advice)
    if inspect.isclass(found) and inspect.isabstract(found):
        missing = ", ".join(sorted(getattr(found, "__abstractmethods__", ())))
        raise _refusal(f"{name} lacks {missing}", spec, "docs/control.md says what a body has")
    return found  # type: ignore[no-any-return]


def _only(module: ModuleType, spec: str) -> Driver:
    """The one body of a file that was named without its class."""
    bodies = _bodies(module)
    if len(bodies) == 1:
        return _attribute(module, bodies[0], spec)
    advice = f"it has {', '.join(bodies)}: {spec}:{bodies[0]}" if bodies else "it has no class of a body"
    raise _refusal("which class of it?", spec, advice)


def _bodies(module: ModuleType) -> Sequence[str]:
    """Names of the classes of bodies that a module defines."""
    own = (name for name, each in vars(module).items() if getattr(each, "__module__", "") == module.__name__)
    return sorted(
        name for name in own if inspect.isclass(vars(module)[name]) and issubclass(vars(module)[name], Body)
    )


# -- words --------------------------------------------------------------------------------------------------------


@contextmanager
def _called(asked: Named) -> Iterator[None]:
    """Say of a driver that was asked for as the voice that it is one, and no body."""
    try:
        yield
    except InputRefused as error:
        fault = error.fault
        if asked.is_voice and fault.where == f"body {asked.spec}":
            start = "no body "
            reason = (
                f"no voice {fault.reason.removeprefix(start)}" if fault.reason.startswith(start) else fault.reason
            )
            raise InputRefused(replace(fault, where=f"voice {asked.spec}", reason=reason)) from error
        raise


def _refusal(reason: str, spec: str, advice: str) -> InputRefused:
    where = spec if spec.startswith("control.") else f"body {spec}"
    return InputRefused(Fault(reason=reason, where=where, advice=advice, service="control"))
