"""Source of landmarks that were recorded: what `engage record` kept of another source, to be perceived once more."""

from collections.abc import Iterator
from pathlib import Path

from msgspec.structs import replace

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.perception import FaceLandmarks
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.perception.eyes.looking import LandmarkSource, SourceSettings, missing


class RecordedSource(LandmarkSource):
    """A recording with the landmarks of one source, from the first of them on."""

    is_live = False

    def __init__(self, settings: SourceSettings) -> None:
        super().__init__(settings)
        try:
            from engage_hri.services.recording.disk import read
            from engage_hri.services.recording.reading import messages
        except ImportError as error:
            raise missing("record", error) from error
        told: dict[str, list[tuple[Seconds, FaceLandmarks]]] = {}
        for received, at in messages(read(Path(settings.path))):
            if isinstance(received.message, FaceLandmarks) and not received.message.over:
                told.setdefault(received.key.rpartition("/")[2], []).append((at, received.message))
        if len(told) != 1:
            reason = f"it has landmarks of {', '.join(sorted(told))}" if told else "it has no landmarks"
            advice = "one source is played: `engage record` of one robot with one" if told else ""
            raise InputRefused(Fault(reason=reason, where=settings.path, advice=advice))
        [self._told] = (sorted(each, key=lambda one: one[0]) for each in told.values())

    def look(self) -> Iterator[FaceLandmarks]:
        begin = self._told[0][0]
        for at, landmarks in self._told:
            yield replace(landmarks, at=Stamp("", at - begin))
