"""Engage: the engagement layer for robots that talk with people.

Start robots with the command `engage`; drive and follow them from a program with what is named here:

    from engage_hri import connect

    async with connect() as robot:                      # a robot of the same name, in any process on any machine
        outcome = await robot.perform("ask.json")       # one fragment of a turn: words, looks, pointing
        async for event in robot.connection_events():   # gaze, eye contact, adjacency pairs, backchannels
            print(event.kind, event.state)

`embedded()` in place of `connect()` runs a simulated robot, or your own, in the program itself.

What a name stands for is loaded when it is first used: a service that only drives motors loads no client.
"""

TYPE_CHECKING = False
"""Checkers take it as true. `typing` itself takes milliseconds in which a Ctrl-C would be a traceback of `engage`."""

if TYPE_CHECKING:
    from typing import Any

    from engage_hri.schemas.behaviors import Gaze as Gaze
    from engage_hri.schemas.behaviors import Head as Head
    from engage_hri.schemas.behaviors import Pointing as Pointing
    from engage_hri.schemas.behaviors import Reference as Reference
    from engage_hri.schemas.behaviors import Speech as Speech
    from engage_hri.schemas.behaviors import SpeechOption as SpeechOption
    from engage_hri.schemas.blocks import Block as Block
    from engage_hri.schemas.body import JointLimit as JointLimit
    from engage_hri.schemas.body import Ray as Ray
    from engage_hri.schemas.faults import EngageError as EngageError
    from engage_hri.schemas.faults import Fault as Fault
    from engage_hri.schemas.faults import InputRefused as InputRefused
    from engage_hri.schemas.faults import RequestRefused as RequestRefused
    from engage_hri.schemas.faults import RunFailed as RunFailed
    from engage_hri.schemas.fragments import FragmentOutcome as FragmentOutcome
    from engage_hri.schemas.fragments import TurnFragment as TurnFragment
    from engage_hri.schemas.perception import Utterance as Utterance
    from engage_hri.schemas.recognition import ConnectionEvent as ConnectionEvent
    from engage_hri.schemas.recognition import Floor as Floor
    from engage_hri.schemas.recognition import Interjection as Interjection
    from engage_hri.schemas.recognition import Statistics as Statistics
    from engage_hri.schemas.summary import Summary as Summary
    from engage_hri.schemas.summary import summary as summary
    from engage_hri.schemas.tool import tool_definition as tool_definition
    from engage_hri.schemas.world import Entity as Entity
    from engage_hri.schemas.world import World as World
    from engage_hri.services.client.conversation.history import PersonSaid as PersonSaid
    from engage_hri.services.client.conversation.history import RobotSaid as RobotSaid
    from engage_hri.services.client.conversation.talk import Conversation as Conversation
    from engage_hri.services.client.conversation.tools import McpServer as McpServer
    from engage_hri.services.client.heard import HeardTurn as HeardTurn
    from engage_hri.services.client.language_models import perform_call as perform_call
    from engage_hri.services.client.language_models import stream as stream
    from engage_hri.services.client.people.perceive import perceive as perceive
    from engage_hri.services.client.people.perceived_person import PerceivedPerson as PerceivedPerson
    from engage_hri.services.client.performing import PerformFailed as PerformFailed
    from engage_hri.services.client.robot import Robot as Robot
    from engage_hri.services.client.robot import connect as connect
    from engage_hri.services.client.turn import RobotTurn as RobotTurn
    from engage_hri.services.client.turn import TurnAnswer as TurnAnswer
    from engage_hri.services.client.turn_ends import EndOfTurn as EndOfTurn
    from engage_hri.services.commandline.embedding import embedded as embedded
    from engage_hri.services.control.bases.one_part_motion import OrdinaryBody as OrdinaryBody
    from engage_hri.services.control.bases.setpoints import SetPointBody as SetPointBody
    from engage_hri.services.control.bases.setpoints import SimulatedServos as SimulatedServos
    from engage_hri.services.control.contract.body import Arrived as Arrived
    from engage_hri.services.control.contract.body import BehaviorRefused as BehaviorRefused
    from engage_hri.services.control.contract.body import Body as Body
    from engage_hri.services.control.contract.body import MovementAuthority as MovementAuthority
    from engage_hri.services.control.contract.body import Reached as Reached
    from engage_hri.services.generation.head.policy import HeadPolicy as HeadPolicy
    from engage_hri.services.generation.head.policy import RobotSign as RobotSign
    from engage_hri.services.generation.turns.policy import TurnPolicy as TurnPolicy

_PLACES = {
    "engage_hri.schemas.behaviors": ("Gaze", "Head", "Pointing", "Reference", "Speech", "SpeechOption"),
    "engage_hri.schemas.blocks": ("Block",),
    "engage_hri.schemas.body": ("JointLimit", "Ray"),
    "engage_hri.schemas.faults": ("EngageError", "Fault", "InputRefused", "RequestRefused", "RunFailed"),
    "engage_hri.schemas.fragments": ("FragmentOutcome", "TurnFragment"),
    "engage_hri.schemas.perception": ("Utterance",),
    "engage_hri.schemas.recognition": ("ConnectionEvent", "Floor", "Interjection", "Statistics"),
    "engage_hri.schemas.summary": ("Summary", "summary"),
    "engage_hri.schemas.tool": ("tool_definition",),
    "engage_hri.schemas.world": ("Entity", "World"),
    "engage_hri.services.client.conversation.history": ("PersonSaid", "RobotSaid"),
    "engage_hri.services.client.conversation.talk": ("Conversation",),
    "engage_hri.services.client.conversation.tools": ("McpServer",),
    "engage_hri.services.client.heard": ("HeardTurn",),
    "engage_hri.services.client.people.perceive": ("perceive",),
    "engage_hri.services.client.people.perceived_person": ("PerceivedPerson",),
    "engage_hri.services.client.performing": ("PerformFailed",),
    "engage_hri.services.client.robot": ("Robot", "connect"),
    "engage_hri.services.client.turn": ("RobotTurn", "TurnAnswer"),
    "engage_hri.services.client.turn_ends": ("EndOfTurn",),
    "engage_hri.services.commandline.embedding": ("embedded",),
    "engage_hri.services.control.contract.body": (
        "Arrived",
        "MovementAuthority",
        "BehaviorRefused",
        "Body",
        "Reached",
    ),
    "engage_hri.services.control.bases.one_part_motion": ("OrdinaryBody",),
    "engage_hri.services.control.bases.setpoints": ("SetPointBody", "SimulatedServos"),
    "engage_hri.services.client.language_models": ("perform_call", "stream"),
    "engage_hri.services.generation.head.policy": ("HeadPolicy", "RobotSign"),
    "engage_hri.services.generation.turns.policy": ("TurnPolicy",),
}
_MODULES = {name: module for module, names in _PLACES.items() for name in names}

__all__ = [
    "Arrived",
    "BehaviorRefused",
    "Block",
    "Body",
    "ConnectionEvent",
    "Conversation",
    "EndOfTurn",
    "EngageError",
    "Entity",
    "Fault",
    "Floor",
    "FragmentOutcome",
    "Gaze",
    "Head",
    "HeadPolicy",
    "HeardTurn",
    "InputRefused",
    "Interjection",
    "JointLimit",
    "McpServer",
    "MovementAuthority",
    "OrdinaryBody",
    "PerceivedPerson",
    "PerformFailed",
    "PersonSaid",
    "Pointing",
    "Ray",
    "Reached",
    "Reference",
    "RequestRefused",
    "Robot",
    "RobotSaid",
    "RobotSign",
    "RobotTurn",
    "RunFailed",
    "SetPointBody",
    "SimulatedServos",
    "Speech",
    "SpeechOption",
    "Statistics",
    "Summary",
    "TurnAnswer",
    "TurnFragment",
    "TurnPolicy",
    "Utterance",
    "World",
    "connect",
    "embedded",
    "perceive",
    "perform_call",
    "stream",
    "summary",
    "tool_definition",
]


def __getattr__(name: str) -> "Any":
    from importlib import import_module

    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_MODULES[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
