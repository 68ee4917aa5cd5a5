"""Words of people who talk among themselves: replies fit what was said, and answers what was asked. Pure."""

from engage_hri.schemas.units import Seconds
from engage_hri.services.client.people.actions import WORD, speaking_time
from engage_hri.services.simulation.chance import Chance

TALK = {
    "I went to the market on Saturday": ("and what did you buy", "I was there as well", "on Saturday it rained"),
    "they had those small pears again": ("I like those", "we could make a cake", "were they expensive"),
    "my sister wants to visit us": ("how nice", "when will she come", "she can have my room"),
    "have you seen the new bridge": ("not yet", "it is beautiful", "we walked over it last week"),
    "it was much colder than last year": ("and it rained all day", "I did not mind", "was there any snow"),
    "so we took the later train": ("was it full", "that was a good idea", "when did you get home"),
    "and then the dog ate all of it": ("all of it", "poor dog", "no way"),
    "we could try that next week": ("next week is fine", "I have no time next week", "let us do that"),
}
"""What opens a subject, with what somebody else may say to it. They do so again and again until the time is over."""
TO_ROBOT = ("What time is it?", "What is that piece called?", "What do you think about it?")
ANSWERS = {
    "are": ("Yes, thank you.", "Not really.", "Quite, thank you."),
    "do": ("Of course I do.", "Yes, I do.", "No, not really."),
    "did": ("Yes, I did.", "No, I did not.", "No, where is it?"),
    "is": ("I think so.", "Yes, it is.", "No, not really."),
    "was": ("Yes, it was.", "A little.", "I think so."),
    "shall": ("Yes, please.", "No, thank you.", "Maybe later."),
    "which": ("The big one.", "This one here.", "I do not know."),
}
"""Answers, by the word with which the question begins, after a name."""
ANY_ANSWER = ("Maybe, I am not sure.", "Why do you ask?")
"""Answers to all other questions."""


def turn(before: str, seconds: Seconds, chance: Chance) -> str:
    """Words of a turn of this length: a reply to the end of the turn before, if that opens a subject, and more."""
    said: list[str] = []
    replies = TALK.get(before.rstrip(".").rsplit(", ", 1)[-1], ())
    subjects = [each for each in TALK if each not in before]
    while not said or speaking_time(", ".join(said)) + WORD < seconds:
        said.append(chance.choice(replies) if replies and not said else chance.choice(subjects))
        subjects = [each for each in subjects if each != said[-1]] or [*TALK]
    return f"{', '.join(said)}."


def answer(question: str, chance: Chance) -> str:
    """Words that answer a question of the robot. question: lower case, without punctuation."""
    begins = next((word for word in question.split() if word in ANSWERS), "")
    return chance.choice(ANSWERS.get(begins, ANY_ANSWER))
