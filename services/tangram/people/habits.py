"""Habits of the stochastic person: how often and how soon people do what the person does, each with its source.

They are values of a class and no settings: a study compares robots that meet the same person. A study of other people
gives `simulate` other habits.
"""

from msgspec import Struct

from engage_hri.schemas.units import Probability, Seconds


class Habits(Struct, frozen=True, kw_only=True):
    """Habits of the stochastic person ("they" below). Delays are least, mean and longest, in seconds."""

    follows_point: Probability = 0.929
    """Share of the robot's points that they follow with a look. Table 2.1, directed gaze."""
    follows_look: Probability = 0.8
    """The same for looks without a point. Ours: the table does not separate gaze with and without pointing."""
    follow_delay: tuple[Seconds, Seconds, Seconds] = (0.0, 0.3, 2.0)
    """Delay from the robot's look or point to theirs. Table 2.1."""
    answers_look: Probability = 0.458
    """Share of the robot's looks at their face that they answer, times `propensity`. Table 2.1: facial gaze."""
    look_delay: tuple[Seconds, Seconds, Seconds] = (0.0, 0.7, 1.5)
    """Delay from the robot's look to theirs. Table 2.1."""
    answers_turn: Probability = 0.682
    """Share of the turns that they answer, or begin to carry out, in time. Table 2.1, adjacency pair. If they do
    not, and the turn was a request, they study the pieces first."""
    answer_delay: tuple[Seconds, Seconds, Seconds] = (0.0, 0.4, 1.1)
    """Delay from the end of the turn to the answer. Table 2.1."""
    study: tuple[Seconds, Seconds, Seconds] = (4.0, 9.0, 60.0)
    """Time for which they study the pieces: the busy regime. Thesis 2.3 has it; the numbers are ours."""
    hesitates: tuple[Seconds, Seconds, Seconds] = (0.2, 0.8, 3.0)
    """Time for which they look at the piece before they reach for it. Ours, with the two that follow: sessions of the
    thesis' participants take 345 s, with a standard deviation of 96 s."""
    fits: tuple[Seconds, Seconds, Seconds] = (1.0, 7.0, 24.0)
    """Time for which they turn it to and fro where it is to lie, until it fits. Ours."""
    pace: tuple[Seconds, Seconds, Seconds] = (0.5, 1.0, 2.5)
    """Factor on these two times and on those of study and search, drawn once for each person. Ours."""
    busy_answers: Probability = 0.25
    """Factor on these three shares, and on what they do unasked, while they study or move pieces. Ours."""
    search: tuple[Seconds, Seconds, Seconds] = (0.3, 1.5, 6.0)
    """Time for which they search for a piece without having seen the robot point or look at it. Ours."""
    hears: Probability = 0.97
    """Share of the robot's utterances that they hear. Ours."""
    guesses: Probability = 0.5
    """Probability of a guess which piece "this" or "that" is, if they have not seen it shown; else they ask. Ours."""
    confuses: Probability = 0.06
    """Share of the pieces, not seen shown, that they confuse with one of the same color or shape. Ours."""
    confuses_shown: Probability = 0.01
    """The same for pieces that they have seen the robot show. Ours."""
    misplaces: Probability = 0.05
    """Share of the pieces that they lay on another side of the landmark than asked. Ours."""
    backchannels: Probability = 0.03
    """Share of the robot's words after which they nod, or say a brief word. Ours."""
    speaks: Probability = 0.3
    """Share of backchannels and answers that are words; the others are nods. Ours."""
    looks_up_every: Seconds = 40.0
    """Mean time between unasked looks at the robot's face, at a `propensity` of 1. Ours."""
    directs_every: Seconds = 90.0
    """Mean time between unasked looks or points at a piece, while the robot is silent. Ours."""
    points: Probability = 0.4
    """Share of these looks and points that are points. Ours."""
    glance: Seconds = 1.2
    """Length of a look at a face or a thing. Ours."""
    reports: Probability = 0.7
    """Share of the laid pieces after which they look at the robot's face, times `propensity`. Ours."""
