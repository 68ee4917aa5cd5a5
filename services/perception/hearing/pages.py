"""Microphones of pages: each is that of a person who sits at one, and comes and goes as they switch it on and off."""

import numpy as np

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.perception import SoundFrame
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.perception.hearing.company import HeardPeople
from engage_hri.services.perception.hearing.intake import HearingIntake
from engage_hri.services.perception.hearing.microphone import SILENT
from engage_hri.services.perception.hearing.speeches import SoundChannel, Speeches
from engage_hri.services.perception.hearing.voice import RATE
from engage_hri.services.perception.sense_faults import SenseFaults

MOST_PAGES = 16
"""Microphones of pages that are heard at once: a detector needs 10 MB, and 0.7 % of a processor."""
OLD: Seconds = 10.0
"""Age from which on sound of a page is of no use."""


class _PageMicrophone:
    """The microphone of a page. number: of the last frame. came: loop time of its arrival."""

    def __init__(self, channel: SoundChannel, number: int) -> None:
        self.channel, self.number, self.came = channel, number, 0.0


class PageEars:
    """Hears all microphones of pages that are on, each that of a person."""

    def __init__(self, bus: Bus, speeches: Speeches, people: HeardPeople, faults: SenseFaults) -> None:
        self._bus, self._speeches, self._people, self._faults = bus, speeches, people, faults
        self._pages: dict[str, _PageMicrophone] = {}

    async def listen(self, intake: HearingIntake) -> None:
        """Hear them for ever. One that gives nothing any more is told, and ends."""
        intake.widen(keys.ANY_SOUND)
        while True:
            until = min((page.came for page in self._pages.values()), default=float("inf")) + SILENT
            received = await intake.inbox.next(until)
            if received is None:
                self._expire()
            elif isinstance(received.message, SoundFrame) and received.key != keys.ROBOT_SOUND:
                with self._bus.containing(received):
                    self._hear(received.key.rpartition("/")[2], received.message)
            else:
                intake.take(received)

    def close(self) -> None:
        """End what is being said."""
        for page in self._pages.values():
            self._speeches.lose(page.channel)

    def _expire(self) -> None:
        for person in [person for person, page in self._pages.items() if self._bus.now() >= page.came + SILENT]:
            self._end(person)
            reason = f"no sound comes any more from the microphone of {person}"
            advice = "is the page, or the computer it is on, asleep or cut off?"
            self._faults.tell(Fault(reason=reason, where=keys.sound(person), advice=advice))

    def _hear(self, person: str, frame: SoundFrame) -> None:
        now, page = self._bus.now(), self._pages.get(person)
        if not frame.samples:
            if page is not None:
                self._end(person)
                self._bus.log.info("the microphone of %s is off", person)
            return
        if frame.rate != RATE:
            reason = f"the sound of {person} has {frame.rate} samples per second: expected {RATE}"
            self._bus.tell_refused(Fault(reason=reason, where=keys.sound(person)), person)
            return
        at = min(self._bus.local(frame.at), now - len(frame.samples) / 2 / RATE)
        if now - at > OLD or (page is None and (page := self._begin(person, frame.number)) is None):
            return
        if frame.number > page.number + 1:
            reason = f"sound from the microphone of {person} is lost on its way"
            advice = "the link of the page is slow"
            self._speeches.tell_loss(page.channel, Fault(reason=reason, where=keys.sound(person), advice=advice))
        page.number, page.came = frame.number, now
        self._speeches.feed(page.channel, np.frombuffer(frame.samples, "<i2"), at)

    def _begin(self, person: str, number: int) -> _PageMicrophone | None:
        """Begin to hear a page with the frame of this number. None: there are so many that it is not heard."""
        if len(self._pages) >= MOST_PAGES:
            reason = f"{MOST_PAGES} microphones are heard already, and that of {person} is not"
            self._bus.tell_refused(Fault(reason=reason, where=keys.sound(person)), person)
            return None
        self._bus.log.info("the microphone of %s is on", person)
        page = self._pages[person] = _PageMicrophone(self._speeches.channel(person), number)
        return page

    def _end(self, person: str) -> None:
        """Hear a page no more: what was being said has ended, and who was brought by it leaves."""
        self._speeches.lose(self._pages.pop(person).channel)
        self._people.let_go(person)
