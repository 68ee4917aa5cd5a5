"""The small manager in German: its rules, its lines, and the names of the pieces. How it talks is `small_talk.py`.

`engage talk --set hearing.language=de` runs it, and with `--manager mine.py` writes a copy of it for you to change.
"""

import asyncio

from engage_hri import Robot, connect
from engage_hri.services.commandline.look.small_talk import SmallTalk

RULES = {
    # what somebody says, in any of these forms, and what the robot answers. In brackets: a thing that it shows, a
    # thing that it looks at, or what its head does meanwhile
    ("hallo", "hallo roboter", "guten tag", "guten morgen"): "[nod] Hallo! Wie geht es dir?",
    ("mir geht es gut", "gut danke", "sehr gut", "ganz gut"): "[nod] Das freut mich.",
    ("ich bin müde", "nicht so gut", "schlecht"): "Das tut mir leid. Bleib ein wenig bei mir.",
    ("wie geht es dir", "wie geht's", "geht es dir gut"): "Mir geht es gut, danke.",
    ("wie heißt du", "wer bist du"): "Ich bin ein Roboter, und einen Namen habe ich noch nicht.",
    ("wie alt bist du",): "Ich habe vor ein paar Minuten angefangen.",
    (
        "was kannst du",
        "was kann ich sagen",
        "hilf mir bitte",
    ): "Ich höre zu, ich schaue, und ich zeige. Du kannst sagen: {examples}.",
    ("ja", "ja bitte"): "[nod] Dann sag zum Beispiel: {examples}.",
    ("nein", "nein danke"): "[nod] Wie du möchtest.",
    ("verstehst du mich", "hörst du mich"): "[nod] Ja, ich verstehe dich.",
    (
        "was liegt auf dem tisch",
        "was ist das",
    ): "[look table] Das sind die Teile eines Puzzles. Welches gefällt dir?",
    ("das blaue", "wo ist das blaue quadrat"): "Da ist [blue-square].",
    ("das rote", "zeig mir das rote quadrat"): "Da ist [red-square].",
    ("erzähl mir einen witz", "bring mich zum lachen"): "Was isst ein Roboter zu Mittag? Ein paar Megabissen.",
    ("ich mag dich",): "[nod] Das ist nett von dir. Ich schaue dich auch gern an.",
    ("danke", "vielen dank"): "[nod] Gern geschehen.",
    ("auf wiedersehen", "tschüss", "ich muss gehen"): "Auf Wiedersehen! [nod] Es war schön, mit dir zu reden.",
}
EXAMPLES = (
    "wo ist das rosa Dreieck", "verstehst du mich", "wie alt bist du", "zeig mir das rote Quadrat",
    "was liegt auf dem Tisch", "wo ist das weiße Trapez", "wie heißt du",
)  # fmt: skip
"""What somebody may say. The robot names one of them as {example}, three as {examples}, and others next time."""
NAMES = {
    "rectangle": "das orange Rechteck",
    "trapezoid": "das weiße Trapez",
    "blue-square": "das blaue Quadrat",
    "green-square": "das grüne Quadrat",
    "purple-square": "das lila Quadrat",
    "red-square": "das rote Quadrat",
    "pink-square": "das rosa Quadrat",
    "yellow-triangle": "das gelbe Dreieck",
    "pink-triangle": "das rosa Dreieck",
    "purple-triangle": "das lila Dreieck",
}
"""What lies on the table of the simulated robot, by id."""
STILL = ("stopp", "stop", "stopp bitte", "halt", "warte", "warte bitte", "sei still", "sei bitte still")
"""What somebody says for the robot to be still. A nod answers it, as it does laughter."""
SILENCE = (
    # seconds in which somebody has said nothing, and what the robot says then; the first one greets
    (1.0, "[nod] Hallo! Schön, dass du da bist. Wie geht es dir?"),
    (15.0, "Du kannst sagen: was kannst du, oder: wo ist das blaue Quadrat."),
    (25.0, "Brauchst du Hilfe?"),
    (40.0, "Ich sehe, du hast zu tun. Auf Wiedersehen!"),
)
PHRASES = (
    *STILL,
    *(phrase for phrases in RULES for phrase in phrases),
    *(f"wo ist {name}" for name in NAMES.values()),
)
"""What somebody may say, for a recognizer that expects phrases."""


async def talk(robot: Robot) -> None:
    """Talk with all who are there, until cancelled."""
    await SmallTalk(
        RULES,
        EXAMPLES,
        STILL,
        otherwise="[shake] Das habe ich nicht verstanden. Sag zum Beispiel: {example}.",
        several="Davon gibt es mehrere. Sag Farbe und Form, so wie: wo ist das blaue Quadrat.",
        silence=SILENCE,
        shows="Da ist [{thing}].",
        names=NAMES,
        parting="Auf Wiedersehen!",
        last="oder: ",
    ).talk(robot)


async def main() -> None:
    async with connect() as robot:
        await talk(robot)


if __name__ == "__main__":
    asyncio.run(main())
