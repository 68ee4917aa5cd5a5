"""The process in which a synthesizer runs: phrases in on standard input, clauses out on standard output.

    python -m engage_hri.services.control.voice.worker

Each message is four bytes of length, little-endian, and MessagePack. It ends with its standard input. It is a
process of
its own since engines block, some crash on odd texts, and one is under another license (docs/decisions/0062).
"""

import os
import signal
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from typing import Any

import msgspec

from engage_hri.schemas.faults import EngageError, Fault
from engage_hri.services.control.voice.clauses import Clause, clause
from engage_hri.services.control.voice.synthesis import Phrase, Synthesizer, refused

HEAD = 4
"""Bytes of the length before each message."""


class Order(msgspec.Struct, frozen=True, tag=True):
    """The synthesizer to make. module, name: of its class. file: that of the module. settings: JSON; empty: none."""

    module: str
    name: str
    file: str = ""
    settings: bytes = b""


class Made(msgspec.Struct, frozen=True, tag=True):
    """The synthesizer is there. rate: its samples per second."""

    rate: int


class Failed(msgspec.Struct, frozen=True, tag=True):
    """The synthesizer cannot be made, or cannot say a phrase."""

    fault: Fault


class Spoken(msgspec.Struct, frozen=True, tag=True):
    """A phrase as sound."""

    clause: Clause


Answer = Made | Failed | Spoken


def packed(message: msgspec.Struct) -> bytes:
    """Pack a message for the pipe."""
    content = msgspec.msgpack.encode(message)
    return len(content).to_bytes(HEAD, "little") + content


def main() -> None:
    """Serve until standard input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the service that asks
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what an engine prints is no answer

    def answer(message: Answer) -> None:
        out.write(packed(message))
        out.flush()

    synthesizer: Synthesizer | None = None
    while (content := _read()) is not None:
        try:
            if synthesizer is None:
                synthesizer = made(msgspec.msgpack.decode(content, type=Order))
                answer(Made(synthesizer.rate))
            else:
                answer(Spoken(clause(synthesizer, msgspec.msgpack.decode(content, type=Phrase))))
        except BrokenPipeError:  # whoever asks is gone
            os._exit(0)
        except EngageError as error:
            answer(Failed(error.fault))
        except Exception as error:
            reason = f"the synthesizer breaks: {type(error).__name__}: {error}"
            answer(Failed(Fault(reason=reason, service="control")))


def _read() -> bytes | None:
    head = sys.stdin.buffer.read(HEAD)
    if len(head) < HEAD:
        return None
    size = int.from_bytes(head, "little")
    content = sys.stdin.buffer.read(size)
    return content if len(content) == size else None


def made(order: Order) -> Synthesizer:
    """Make a synthesizer. Raises SynthesisFailed, or what its class raises."""
    kind: Any = _module(order)
    for step in order.name.split("."):
        kind = getattr(kind, step, None)
    if not callable(kind):
        raise refused(f"no class {order.name} in {order.module}", "it is to stand in a module, not in a function")
    settings: type[msgspec.Struct] | None = getattr(kind, "Settings", None)
    make: Callable[..., Synthesizer] = kind
    return make() if settings is None else make(msgspec.json.decode(order.settings or b"{}", type=settings))


def _module(order: Order) -> Any:
    """The module of a class, as the asking process has it: a file may have been loaded under a name of our own."""
    try:
        return import_module(order.module)
    except ModuleNotFoundError:
        if not order.file:
            raise
    plan = spec_from_file_location(order.module, order.file)
    assert plan is not None
    assert plan.loader is not None
    module = module_from_spec(plan)
    sys.modules[order.module] = module
    sys.path.append(os.path.dirname(order.file))
    plan.loader.exec_module(module)
    return module


if __name__ == "__main__":
    main()
