"""Conditions of a study, set by who conducts it."""

from engage_hri.schemas import keys
from engage_hri.schemas.conditions import ConditionSet, SetCondition, StudyCondition
from engage_hri.schemas.units import Seconds
from engage_hri.services.client.faulting import Faulting
from engage_hri.services.client.feeds import Feed
from engage_hri.services.client.results import in_time


class Studied(Faulting):
    """The part of `Robot` that sets and follows the condition of a study."""

    async def set_condition(
        self, name: str = "", *, speech_only: bool = False, by: str = "", timeout: Seconds | None = None
    ) -> None:
        """Begin a condition; from now on what the robot does counts under this name, until another begins.

        name: at most 80 characters; empty: what comes belongs to none. speech_only: the robot says the words of the
            task and nothing else, its head to the upper right (`degraded-generation`; thesis 5.3).
        by: who sets it, for the record. Rules for access keep this to operators and wizards.
        timeout: seconds to wait for the request to be accepted; None: for ever.

        Raises:
            InputRefused: the name is too long. Nothing has changed.
            RunFailed: generation is gone, or has not come within `timeout`.
        """
        request = SetCondition(id=self._request_id("condition"), name=name, speech_only=speech_only, by=by)
        outcome = await self._ask(keys.CONDITION, request, timeout)
        assert isinstance(outcome, ConditionSet)

    def conditions(self) -> Feed[StudyCondition]:
        """Follow the condition: the one in force now, and each that begins."""
        return self._feed((StudyCondition,), keys.STUDY_CONDITION)

    async def condition(self, timeout: Seconds | None = None) -> StudyCondition:
        """Return the condition that is in force now; waits for generation.

        timeout: seconds to wait; None: for ever.

        Raises:
            NoReply: none within `timeout`.
        """
        with self.conditions() as feed:
            return in_time(await feed.next(timeout), "condition of a study", timeout)
