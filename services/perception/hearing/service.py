"""The service of hearing: its ears, at pages or at a device, and what was heard of whom until it ends."""

from engage_hri.schemas import keys
from engage_hri.services.bus.interface import Bus
from engage_hri.services.perception.hearing.company import HeardPeople
from engage_hri.services.perception.hearing.config import PAGE, HearingConfig
from engage_hri.services.perception.hearing.device import DeviceEars
from engage_hri.services.perception.hearing.intake import HearingIntake
from engage_hri.services.perception.hearing.pages import PageEars
from engage_hri.services.perception.hearing.speeches import Speeches, is_cancelling
from engage_hri.services.perception.sense_faults import SenseFaults
from engage_hri.services.runtime.service import Ready, tell_settings


async def hear(bus: Bus, ready: Ready, config: HearingConfig) -> None:
    """Serve until cancelled, or until the file is over and all that was said in it is told.

    What is said before recognition is there would be lost: a file begins then, and pages are heard from then on.

    Raises InputRefused: there is no such sound or recognizer, or a package is not installed.
    """
    has_pages = config.source == PAGE
    more = () if has_pages or config.people else (keys.ANY_HEAD_POSE,)
    own = (keys.ROBOT_SOUND,) if is_cancelling(config) else ()
    patterns = keys.ANY_ROBOT_ALIVE, keys.WORLD, keys.ROBOT_ACTION, *more, *own
    tell_settings(bus, "hearing", config)
    people, faults = HeardPeople(bus), SenseFaults(bus, "hearing again")
    speeches = Speeches(bus, config, people, faults)
    ears = PageEars(bus, speeches, people, faults) if has_pages else DeviceEars(bus, config, speeches, faults)
    intake = HearingIntake(bus, patterns, people, speeches)
    try:
        await speeches.made()
        ready()
        await intake.wait_for_recognition(config.people)
        await ears.listen(intake)
    finally:
        intake.inbox.close()
        ears.close()
        speeches.close()
        people.let_go()
