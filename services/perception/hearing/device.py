"""Ears at a device or a file: a channel of its sound for each person."""

from collections.abc import AsyncGenerator
from contextlib import aclosing

import numpy as np

from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.perception.hearing.config import HearingConfig
from engage_hri.services.perception.hearing.intake import HearingIntake
from engage_hri.services.perception.hearing.microphone import SoundLost, opened
from engage_hri.services.perception.hearing.sound import Piece
from engage_hri.services.perception.hearing.speeches import Speeches
from engage_hri.services.perception.sense_faults import SenseFaults

AGAIN: Seconds = 2.0
"""Time after which a device is tried again that gave no sound."""


class DeviceEars:
    """Hears the source of the settings."""

    def __init__(self, bus: Bus, config: HearingConfig, speeches: Speeches, faults: SenseFaults) -> None:
        """Raises InputRefused: there is no such source."""
        self._bus, self._speeches, self._faults = bus, speeches, faults
        people = config.people or ("",)
        self._sound = opened(config.source, len(people))
        self._channels = [speeches.channel(person) for person in people]

    async def listen(self, intake: HearingIntake) -> None:
        """Hear all that the source gives; what a device does not give is told, and it is tried again."""
        while True:
            try:
                async with aclosing(self._sound()) as sound:
                    await self._hear(sound, intake)
                return
            except SoundLost as lost:
                self.close()
                self._faults.lose(lost.fault)
            await intake.wait_until(self._bus.now() + AGAIN)

    async def _hear(self, sound: AsyncGenerator[Piece, None], intake: HearingIntake) -> None:
        async for piece in sound:
            self._faults.get()
            intake.catch_up()
            for number, channel in enumerate(self._channels):
                self._speeches.feed(channel, np.ascontiguousarray(piece.samples[:, number]), piece.at)
        self.close()
        await self._speeches.known()

    def close(self) -> None:
        """End what is being said."""
        for channel in self._channels:
            self._speeches.lose(channel)
