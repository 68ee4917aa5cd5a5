"""Habits of people who talk among themselves: how soon, how long and how often they do what, each with its source.

Measured times are drawn from the deciles of people's own times: these are skewed, and what robots get wrong in talk
is at the far end. AMI: two meetings of four people (AMI Meeting Corpus, CC BY 4.0). IFADV: a quarter of an hour of a
dialogue that was coded by hand.
"""

from itertools import pairwise

from msgspec import Struct

from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.simulation.chance import Chance


class Deciles(Struct, frozen=True):
    """A distribution of times, in ten equally likely parts. bounds: eleven times, growing."""

    bounds: tuple[Seconds, ...]

    def draw(self, chance: Chance) -> Seconds:
        return chance.uniform(*chance.choice(tuple(pairwise(self.bounds))))


class PartyHabits(Struct, frozen=True, kw_only=True):
    """Habits of all who sit together."""

    turn: Deciles = Deciles((0.27, 0.35, 0.7, 1.07, 1.42, 1.92, 2.94, 4.16, 6.06, 9.0, 12.21))
    """Length of what they say. AMI: 399 turns that took the floor; 5 of 100 at either end are left out."""
    gap: Deciles = Deciles((-1.76, -1.11, -0.48, -0.17, 0.07, 0.29, 0.48, 0.73, 1.16, 2.15, 4.46))
    """Time from the end of a turn to the next of another; negative: it begins before that end. The same turns."""
    answer: Deciles = Deciles((0.2, 0.5, 0.8, 1.1, 1.4, 1.6, 1.8, 2.0, 2.5, 3.5, 5.9))
    """Time from the end of the robot's question to the answer: 69 answers of people to a product robot, of a public
    study of turn-taking; one after 61 s is left out."""
    feedback: Deciles = Deciles((0.2, 0.25, 0.3, 0.34, 0.38, 0.42, 0.46, 0.52, 0.6, 0.8, 1.1))
    """Length of a listener's words: IFADV has 9 of 143 above 0.8 s; the lower part is AMI, within others' turns."""
    feedback_every: Seconds = 6.0
    """Mean time between these while somebody speaks to them. IFADV: 143 in a quarter of an hour."""
    feedback_to_robot_every: Seconds = 12.0
    """The same while the robot does. Ours."""
    nods: Probability = 0.5
    """Share of these that come with a nod. Ours."""
    nods_only: Probability = 0.3
    """Share of these that are a nod without words. Ours."""
    laughs: Probability = 0.06
    """Share of the turns after which some laugh. IFADV: 15 laughs in a quarter of an hour."""
    laugh: tuple[Seconds, Seconds] = (0.4, 1.8)
    """Shortest and longest laugh. IFADV: 7 of 15 above 0.8 s."""
    look: tuple[Seconds, Seconds] = (0.2, 0.6)
    """Time in which they look at who has begun to speak. Ours."""
    look_at_speaker: Probability = 0.94
    """Share of the speakers that they look at. IFADV: for 91 to 96 % of the time that they listen."""
    away_every: Seconds = 60.0 / 7
    """Mean time between looks away. IFADV: 5 to 9 a minute."""
    away: Deciles = Deciles((0.5, 0.58, 0.66, 0.74, 0.82, 0.9, 1.05, 1.25, 1.6, 2.3, 3.0))
    """Length of a look away. IFADV: median 0.74 to 1.0 s, 90 of 100 below 2 to 3 s."""
    away_at_beginning: Probability = 0.7
    """Share of their long turns that they begin with a look away. Kendon 1967; IFADV: 20 to 32 % of all turns."""
    long_turn: Seconds = 4.0
    """Length from which a turn is a long one. Ours."""
    replies: Probability = 0.7
    """Share of the turns after which the one who was spoken to speaks next, to the speaker. Ours."""
    addresses_robot: Probability = 0.08
    """Share of the turns that are to the robot. Ours: in a meeting of four one in three would be, of equals."""
    yields: Probability = 0.7
    """Share of the robot's turns during which the others are silent, and wait for the answer. Ours."""
    answers_for_another: Probability = 0.05
    """Share of the robot's questions that another one answers. Ours."""
