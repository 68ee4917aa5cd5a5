"""The policies of turns in their order, the strongest first. A new one is a file, and a line here. Pure."""

from collections.abc import Mapping

from engage_hri.services.generation.turns.endings import InterruptionPolicy, LeavingPolicy, SilencePolicy
from engage_hri.services.generation.turns.next_speaker import NextSpeakerPolicy
from engage_hri.services.generation.turns.policy import TurnPolicy

OWN: Mapping[str, type[TurnPolicy]] = {
    "leaving": LeavingPolicy,
    "silence": SilencePolicy,
    "interruption": InterruptionPolicy,
    "next-speaker": NextSpeakerPolicy,
}
