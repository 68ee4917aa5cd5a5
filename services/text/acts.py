"""Stage directions: words that say what a speaker does while speaking, and that are not to be said.

Models write `[laughs]`, `(sighs)` and `*waves*`. What stands there is a direction if its first word, adverbs aside,
is an act of the list below. In brackets more words are: sounds and manners, for no sentence has them in brackets. So
`*very*` is an emphasis, `(looks like rain)` a remark, and `[sic]` a word.
"""

import re
from typing import Literal

Around = Literal["[", "(", "*"]

LONGEST = 60
"""Characters of the longest direction."""
_MOST_WORDS = 8
_FEW_WORDS = 5
"""Words of the longest direction in parentheses: longer ones are remarks."""

_STEMS_WORDS = """
laugh chuckle giggle snicker snigger smirk smile grin sigh groan moan gasp gulp cough sneeze sniff sniffle snort
sob whimper weep yawn hum whistle whisper mumble mutter murmur blush wink blink nod shrug frown grimace wince
shudder shiver bow wave clap applaud hesitate exhale inhale chortle cackle beam facepalm curtsy pout hiccup pant
"""
_STEMS = _STEMS_WORDS.split()
_WIDE_STEMS_WORDS = """
look turn point lean step walk stand sit raise lower tilt shake scratch rub stretch reach gesture pause think
ponder glance gaze stare cry cheer hug kiss pat tap jump dance spin roll clear take breathe swallow sing speak
stop wait squint peer cross fold lift drop nudge bounce scream shout squeal purr growl hiss beep whir listen
interrupt
"""
_WIDE_STEMS = _WIDE_STEMS_WORDS.split()
_OTHERS_WORDS = """
lacht lächelt seufzt nickt winkt hustet gähnt kichert grinst zwinkert räuspert flüstert schluchzt stöhnt lachend
lächelnd seufzend nickend flüsternd rit rires soupire sourit hoche tousse chuchote bâille ríe ríen risas suspira
sonríe asiente tose susurra bosteza guiña ride risate sospira sorride annuisce tossisce sussurra ri risos sorri
acena tosse glimlacht zucht knikt hoest fluistert смеётся смеется улыбается вздыхает кивает кашляет шепчет
śmieje wzdycha kiwa uśmiecha skrattar ler suckar nickar griner smiler sukker nikker
笑 大笑 微笑 叹气 点头 咳嗽 笑い 苦笑 ため息
拍手
"""
_OTHERS = _OTHERS_WORDS.split()
_SOUNDS_WORDS = """
laughter applause music silence pause beat sound sounds noise static crosstalk inaudible unintelligible sigh
sighs laugh chuckle chuckles giggle giggles gasp gasps cough coughs groan groans gulp yawn yawns sniff sobs
whistle hum clap claps smile grin nod wave wink shrug bow breath breathing sfx breathy exhale inhale pausa
stille applaus musik musique música musica gelächter seufzer silencio silenzio
"""
_SOUNDS = _SOUNDS_WORDS.split()
_MANNERS_WORDS = """
excited excitedly sarcastic sarcastically curious curiously happy happily sad sadly angry angrily nervous
nervously cheerful cheerfully calm calmly serious seriously softly quietly loudly gently warmly brightly playful
playfully mischievous mischievously thoughtful thoughtfully surprised amused confused embarrassed annoyed tired
tiredly enthusiastic enthusiastically dramatic dramatically deadpan monotone whispered whispering shouting
singing crying laughing sighing smiling slow slowly fast quickly aside breathless breathlessly jokingly teasing
teasingly
"""
_MANNERS = _MANNERS_WORDS.split()


def _forms(stems: list[str]) -> frozenset[str]:
    """Third persons and participles of English verbs: what directions are written in."""
    found = set()
    for stem in stems:
        is_sibilant = stem.endswith(("s", "sh", "ch", "x", "z"))
        root = stem.removesuffix("e")
        ends = stem[-2:]
        found |= {stem + ("es" if is_sibilant else "s"), f"{root}ing"}
        if stem.endswith("y") and len(stem) > 2 and stem[-2] not in "aeiou":
            found |= {f"{stem[:-1]}ies"}
        if len(ends) == 2 and ends[1] not in "aeiouwxy" and ends[0] in "aeiou" and stem[-3:-2] not in tuple("aeiou"):
            found |= {f"{stem}{ends[1]}ing"}
    return frozenset(found)


ACTS = _forms(_STEMS) | frozenset(_OTHERS) | {"clears throat", "shakes head"}
_WIDE = ACTS | _forms(_WIDE_STEMS) | {"takes", "makes", "does", "gives", "puts"}
_IN_BRACKETS = _WIDE | frozenset(_SOUNDS) | frozenset(_MANNERS)
_KNOWN = {"[": _IN_BRACKETS, "(": ACTS, "*": _WIDE}
_NAMED = frozenset({"clears throat", "clearing throat", "shakes head", "takes breath", "deep breath", "long pause"})
_WORD = re.compile(r"[^\W\d_]+(?:['’-][^\W\d_]+)*")
_ADVERB = re.compile(r"[a-z]+ly$")
_NOT_ADVERBS = frozenset({"only", "family", "early", "fly", "reply", "apply", "supply", "july", "italy", "really"})
_ARTICLES = frozenset({"his", "her", "their", "its", "my", "your", "the", "a", "an"})


def is_direction(content: str, around: Around) -> bool:
    """Tell whether what stands in brackets, parentheses or asterisks is a stage direction. around: how it opens."""
    if len(content) > LONGEST or any(each in ".!?:;=/\\<>{}@#" or each.isdigit() for each in content):
        return False
    words = [each.lower() for each in _WORD.findall(content)]
    if not words or len(words) > (_FEW_WORDS if around == "(" else _MOST_WORDS):
        return False
    if " ".join(each for each in words if each not in _ARTICLES) in _NAMED:
        return True
    known = _KNOWN[around]
    if around == "[" and all(each in _MANNERS or each == "and" for each in words):
        return True
    while len(words) > 1 and _ADVERB.match(words[0]) and words[0] not in _NOT_ADVERBS:
        words = words[1:]
    return words[0] in known and (around != "[" or words[0] in _WIDE or len(words) <= 3)


def may_be_direction(content: str, around: Around) -> bool:
    """Tell whether the beginning of what stands there may become one."""
    if len(content) > LONGEST or "\n" in content:
        return False
    first = _WORD.search(content)
    if first is None or first.end() == len(content):
        return not any(each in ".!?:;=/\\<>{}@#" or each.isdigit() for each in content)
    return (
        is_direction(content, around)
        or _ADVERB.match(first.group().lower()) is not None
        or (any(each.startswith(f"{first.group().lower()} ") for each in _NAMED))
    )
