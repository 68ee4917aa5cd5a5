"""A server that transcribes: `POST .../audio/transcriptions`, as OpenAI's and those that are made like it.

The sound of people leaves this machine if the server is another one.
"""

import io
import json
import os
import re
import wave
from urllib.error import HTTPError, URLError
from urllib.request import Request, urlopen

from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.services.perception.hearing.recognizing import (
    Listening,
    RecognizerSettings,
    SpeechRecognizer,
    SpeechWords,
    Whole,
)
from engage_hri.services.perception.hearing.voice import RATE, Samples

KEY = "ENGAGE_RECOGNIZER_KEY"
PATIENCE = 15.0
"""Seconds that an answer may take."""
BOUNDARY = "engage-7d1f3c0b9a54"


class Endpoint(SpeechRecognizer):
    """A recognizer on a server."""

    def __init__(self, settings: RecognizerSettings) -> None:
        if not re.match("https?://", settings.address):
            reason, advice = "no address of a server", "hearing.address=http://127.0.0.1:8000/v1"
            raise InputRefused(Fault(reason=reason, where="hearing.address", advice=advice))
        self._address = f"{settings.address.rstrip('/')}/audio/transcriptions"
        self._fields = {
            "model": settings.model or "whisper-1", "language": re.split("[-_]", settings.language)[0],
            "response_format": "json", "prompt": ". ".join(settings.phrases),
        }  # fmt: skip

    def listen(self) -> Listening:
        return Whole(self._understand)

    def _understand(self, samples: Samples) -> SpeechWords:
        headers = {"Content-Type": f"multipart/form-data; boundary={BOUNDARY}"}
        if key := os.environ.get(KEY):
            headers["Authorization"] = f"Bearer {key}"
        request = Request(self._address, _form(self._fields, _wav(samples)), headers)
        try:
            with urlopen(request, timeout=PATIENCE) as answer:
                return SpeechWords(str(json.loads(answer.read())["text"]))
        except HTTPError as error:
            said = error.read(300).decode(errors="replace")
            raise _failed(self._address, f"{error.code} {error.reason}: {said}") from error
        except (URLError, OSError) as error:
            raise _failed(self._address, str(getattr(error, "reason", error))) from error
        except (ValueError, KeyError, TypeError) as error:
            raise _failed(self._address, "its answer is no JSON object with a `text`") from error


def _failed(address: str, reason: str) -> EngageError:
    return EngageError(Fault(reason=f"the recognizer at {address}: {reason}", where="hearing.address"))


def _wav(samples: Samples) -> bytes:
    file = io.BytesIO()
    with wave.open(file, "wb") as written:
        written.setnchannels(1)
        written.setsampwidth(2)
        written.setframerate(RATE)
        written.writeframes(samples.astype("<i2").tobytes())
    return file.getvalue()


def _form(fields: dict[str, str], sound: bytes) -> bytes:
    parts = [
        f'--{BOUNDARY}\r\nContent-Disposition: form-data; name="{name}"\r\n\r\n{value}\r\n'.encode()
        for name, value in fields.items()
        if value
    ]
    head = f'--{BOUNDARY}\r\nContent-Disposition: form-data; name="file"; filename="speech.wav"\r\n'
    return b"".join(
        [*parts, f"{head}Content-Type: audio/wav\r\n\r\n".encode(), sound, f"\r\n--{BOUNDARY}--\r\n".encode()]
    )
