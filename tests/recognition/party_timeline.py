"""Timelines of simulated parties: what they say to whom is known, so that the coder judges what recognition tells."""

from engage_hri.schemas.perception import ActionBegan, ActionEnded, Utterance
from engage_hri.services.recognition.config import RecognitionConfig
from tests.recognition.coder import Coder, as_told, only_one_has, rounded
from tests.recognition.observations import ROBOT
from tests.recognition.timeline import LISTENING, OTHER, Instant, Span, Timeline, Turn
from tests.simulation.party_play import Play

LASTS = 180.0
JUDGED = 160.0
"""What begins later may not be decided when the play is over."""
BEFORE, VOICE, AFTER = -1, 10**5, 10**6
"""Places in the order of what happens at one time: the robot's turns, nods, voices, words."""


def timeline(play: Play) -> Timeline:
    """Write a play down."""
    found = Timeline(play.party.people, is_worded=True, tells="late")
    attended: dict[str, str] = {}
    nods: dict[str, tuple[Instant, str]] = {}
    known: dict[tuple[str, float], float] = {}
    for number, told in enumerate(play.messages):
        match told:
            case ActionBegan(action="look", targets=targets):
                # Nobody tells to whom a nod is: of who looks at nobody it is to the robot, as the page has it.
                attended[told.actor] = targets[0] if targets else ROBOT
            case ActionBegan(action="nod"):
                nods[told.actor] = (told.at.seconds, number), attended.get(told.actor, ROBOT)
            case ActionEnded(action="nod") if told.actor in nods:
                since, to = nods.pop(told.actor)
                found.spans.append(Span(told.actor, "nod", since, (told.at.seconds, number), to))
            case Utterance(final=True):
                known[told.actor, round(told.began.seconds, 4)] = told.at.seconds
    for said in play.said:
        words = LISTENING[0] if said.kind == "feedback" else OTHER[0] if said.words else ""
        speech = Span(said.actor, "speak", (said.began, VOICE), (said.ended, VOICE), said.to, words)
        if words and (at := known.get((said.actor, round(said.began, 4)))) is not None:
            speech.known = at, AFTER
        found.spans.append(speech)
    for number, asked in enumerate(play.questions):
        since, until = (asked.began, BEFORE), (asked.ended, BEFORE)
        found.turns.append(Turn(f"turn{number}", "asks", (asked.to,), [(since, until)], until))
    return found


def differences(seed: int) -> tuple[int, list[str]]:
    """Number of events of a party of one to five, and what only one of recognition and the coder has."""
    play = Play(1 + seed % 5, seed, tells=True)
    play.until(LASTS)
    coded = Coder(timeline(play), RecognitionConfig().adjacency_pair_limit).events()
    told = [each for each in as_told(play.events) if each.started < JUDGED]
    return only_one_has(rounded(told), rounded([each for each in coded if each.started < JUDGED]))
