"""The person of thesis Appendix B, step by step, as rules. Steps 7-17 are missing in the source: those are ours.

Delays are human reaction times, chosen so that at least 0.1 s lies between any two events of the scenario.
"""

from collections.abc import Mapping

from msgspec import structs

from engage_hri.services.simulation.human import (
    AWAY,
    FACE,
    TABLE,
    Begun,
    Ended,
    Entrance,
    EventChanged,
    Grab,
    Lay,
    Leave,
    LookAt,
    Pause,
    RobotDoes,
    Rule,
    Sit,
    Withdraw,
    Word,
)

GLANCE = 0.2
"""Delay from a word to the gaze that it causes."""
FOLLOW = 0.3
"""Delay from a point of the robot, seen, to the look there."""
MOVE = 2.1
"""Delay from the end of a request to the hand's next motion. The robot keeps looking at the person's eyes until its
facial gaze is answered or has failed, 1.9 s after it began; a hand that moved earlier would draw its gaze away.
"""


def rules() -> tuple[Rule, ...]:
    """Rules of the whole script."""
    return (*GREETING, *FIRST_PIECE, *OURS, *LAST_PIECES, *GOODBYE, *FIXES)


def misplacing_rules() -> tuple[Rule, ...]:
    """Rules of the script, but in step 14 (one of ours) the piece is laid at a wrong place."""
    wrong = Lay("pink-square", "bottom left", "red-square")
    return tuple(
        structs.replace(rule, do=tuple(wrong if isinstance(act, Lay) else act for act in rule.do))
        if rule.step == "step-14-ours"
        else rule
        for rule in rules()
    )


# -- steps 1 to 4 -----------------------------------------------------------------------------------------------

GREETING = (
    Rule(
        "step-1",
        Entrance(),
        (
            LookAt(TABLE), Pause(0.8), Sit(), Pause(0.8),
            LookAt(FACE), Pause(1.6), LookAt(TABLE), Pause(1.2), LookAt(FACE),
        ),
    ),
    Rule("step-3", Word("table"), (LookAt(TABLE),), GLANCE),
    Rule("step-3", Word("see"), (LookAt(FACE),), GLANCE),
    Rule("step-3", Word("triangles"), (LookAt(TABLE),), 0.05),
    Rule("step-3", Word("and"), (LookAt("rectangle"),), 0.05),
    Rule("step-3", RobotDoes("point", "trapezoid"), (LookAt("trapezoid"),), FOLLOW),
    Rule("step-3", Word("of"), (LookAt(FACE),), 0.1),
    Rule("step-3", Ended(), (LookAt(TABLE),), FOLLOW),
    Rule("step-4", Word("okay"), (LookAt(TABLE),), GLANCE),
)  # fmt: skip


# -- moving pieces ----------------------------------------------------------------------------------------------


PLACEMENTS: Mapping[str, Lay] = {
    "step-5": Lay("blue-square", "top", "rectangle"),
    "step-8-ours": Lay("trapezoid", "top", "blue-square"),
    "step-10-ours": Lay("yellow-triangle", "bottom", "rectangle"),
    "step-12-ours": Lay("red-square", "bottom left", "yellow-triangle"),
    "step-14-ours": Lay("pink-square", "bottom right", "yellow-triangle"),
    "step-16-ours": Lay("pink-triangle", "top left", "red-square"),
    "step-17-ours": Lay("purple-square", "right", "blue-square"),
    "step-18": Lay("purple-triangle", "top right", "pink-square"),
    "step-21": Lay("green-square", "left", "blue-square"),
}
"""Placements as the robot asks for them, by step."""


def moves(step: str, again: str = "") -> tuple[Rule, ...]:
    """Rules of a person who does what the robot asks for in a step, as in steps 5 and 6.

    again: suffix of the step where the robot asks once more.
    """
    lay, step = PLACEMENTS[step], step + again
    piece, landmark = lay.piece, lay.landmark
    return (
        Rule(step, RobotDoes("point", piece), (LookAt(piece),), FOLLOW),
        Rule(step, Word("so"), (Grab(piece),), GLANCE),
        Rule(step, EventChanged("directed_gaze", "started", landmark), (LookAt(landmark),), 0.6),
        Rule(step, Ended(), (lay, Withdraw(), Pause(0.2), LookAt(FACE)), MOVE),
    )


FIRST_PIECE = moves("step-5")


def approves(step: str) -> tuple[Rule, ...]:
    """Rules of the person while the robot says "Ummmm, good", as in steps 20 and 23."""
    return (
        Rule(f"{step}-a", Word("ummmm"), (LookAt(TABLE),), GLANCE),
        Rule(f"{step}-b", Begun(), (LookAt(FACE),), 0.1),
        Rule(f"{step}-b", Ended(), (LookAt(TABLE),), FOLLOW),
    )


OURS = (
    *approves("step-7-ours"),
    *moves("step-8-ours"),
    *approves("step-9-ours"),
    *moves("step-10-ours"),
    *approves("step-11-ours"),
    *moves("step-12-ours"),
    *approves("step-13-ours"),
    *moves("step-14-ours"),
    *approves("step-15-ours"),
    *moves("step-16-ours"),
    *moves("step-17-ours"),
)


# -- steps 18 to 26 ---------------------------------------------------------------------------------------------

LAST_PIECES = (
    # The person is inattentive while the robot says which piece: its directed gaze fails.
    Rule("step-18", Begun(), (LookAt(AWAY),), 0.05),
    Rule("step-18", Word("that"), (LookAt(FACE),), GLANCE),
    # The person looks at the table in time for the landmark, but not while the first event still waits.
    Rule("step-18", EventChanged("directed_gaze", "failed", "purple-triangle"), (LookAt(TABLE),), 0.05),
    # This look comes within 2 s after that event failed: it counts as the answer, not as a direction of its own.
    Rule("step-18", Word("pink"), (LookAt("purple-triangle"),), 0.05),
    Rule(
        "step-18",
        Ended(),
        (Grab("purple-triangle"), Lay("purple-triangle", "top right", "trapezoid"), Withdraw()),
        MOVE,
    ),
    Rule("step-20-a", Begun(), (LookAt(TABLE),), 0.1),
    Rule("step-20-a", Word("ummmm"), (LookAt(FACE),), GLANCE),
    Rule("step-20-b", Ended(), (LookAt(TABLE),), FOLLOW),
    Rule("step-21", Word("please"), (LookAt(FACE),), GLANCE),
    Rule("step-21", RobotDoes("point", "green-square"), (LookAt("green-square"),), FOLLOW),
    Rule("step-21", Word("this"), (LookAt(FACE),), 0.4),
    Rule("step-21", Word("side"), (LookAt(TABLE),), 0.05),
    Rule(
        "step-21",
        Ended(),
        (
            LookAt("green-square"), Pause(0.3), Grab("green-square"),
            Lay("green-square", "left", "blue-square"), Withdraw(), Pause(0.2), LookAt(FACE),
        ),
        MOVE,
    ),
    Rule("step-23-a", Begun(), (LookAt(FACE),), 0.1),
    Rule("step-23-a", Word("ummmm"), (LookAt(TABLE),), GLANCE),
    Rule("step-23-a", RobotDoes("look", "table"), (LookAt(FACE),), FOLLOW),
)  # fmt: skip

GOODBYE = (
    Rule("step-24", Word("an"), (LookAt(TABLE),), GLANCE),
    Rule("step-25", Word("thanks"), (LookAt(FACE),), GLANCE),
    Rule(
        "step-25",
        Ended(),
        (LookAt(TABLE), Pause(1.2), LookAt(FACE), Pause(1.2), LookAt(TABLE), Pause(0.8), Leave()),
        0.5,
    ),
)


# -- when the robot asks again ----------------------------------------------------------------------------------

FIXES = tuple(rule for step in PLACEMENTS for again in ("-fix", "-again") for rule in moves(step, again))
