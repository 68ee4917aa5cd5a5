"""Text front end: the stage between whoever writes a text and the voice that says it. Pure.

    marks.py   reads a text bit by bit: what is for the ear, references, and what is for the eye alone
    ends.py    where sentences and clauses end, as far as the text is known
    ear.py     a whole text as an engine is given it, with the places of its characters in the author's text

For words that are heard:

    listening.py   words of listeners
    own_words.py   words of the robot that come back as somebody's

Writers use Markdown, tags, emoji and stage directions because their text is mostly read. A voice must not say these,
and must say all else. One rule for everybody lies here: `stream` reads bits of text with it, generation and the
voices whole texts. docs/language-models.md says in words what is said and what is not.
"""
