"""Stage directions: words that say what a speaker does while speaking, and that are not to be said.

Models write `[laughs]`, `(sighs)` and `*waves*`. What stands there is a direction if its first word, adverbs aside,
is an act of the list below. In brackets more words are: sounds and manners, for no sentence has them in brackets. So
`*very*` is an emphasis, `(looks like rain)` a remark, and `[sic]` a word.
"""

from collections.abc import Iterator, Mapping
from typing import Any

_STEMS = """
laugh chuckle giggle snicker snigger smirk smile grin sigh groan moan gasp gulp cough sneeze sniff sniffle snort
sob whimper weep yawn hum whistle whisper mumble mutter murmur blush wink blink nod shrug frown grimace wince
shudder shiver bow wave clap applaud hesitate exhale inhale chortle cackle beam facepalm curtsy pout hiccup pant
"""
_WIDE_STEMS = """
look turn point lean step walk stand sit raise lower tilt shake scratch rub stretch reach gesture pause think
ponder glance gaze stare cry cheer hug kiss pat tap jump dance spin roll clear take breathe swallow sing speak
stop wait make give put squint peer cross fold lift drop nudge bounce scream shout squeal purr growl hiss
beep whir listen interrupt
"""
_OTHERS = """
lacht lächelt seufzt nickt winkt hustet gähnt kichert grinst zwinkert räuspert flüstert schluchzt stöhnt lachend
lächelnd seufzend nickend flüsternd rit rires soupire sourit hoche tousse chuchote bâille ríe ríen risas suspira
sonríe asiente tose susurra bosteza guiña ride risate sospira sorride annuisce tossisce sussurra ri risos sorri
acena tosse glimlacht zucht knikt hoest fluistert смеётся смеется улыбается вздыхает кивает кашляет шепчет
śmieje wzdycha kiwa uśmiecha skrattar ler suckar nickar griner smiler sukker nikker
笑 大笑 微笑 叹气 点头 咳嗽 笑い 苦笑 ため息 拍手
"""
_SOUNDS = """
laughter applause music silence pause beat sound sounds noise static crosstalk inaudible unintelligible sigh
sighs laugh chuckle chuckles giggle giggles gasp gasps cough coughs groan groans gulp yawn yawns sniff sobs
whistle hum clap claps smile grin nod wave wink shrug bow breath breathing sfx breathy exhale inhale pausa
stille applaus musik musique música musica gelächter seufzer silencio silenzio
"""
_MANNERS = """
excited excitedly sarcastic sarcastically curious curiously happy happily sad sadly angry angrily nervous
nervously cheerful cheerfully calm calmly serious seriously softly quietly loudly gently warmly brightly playful
playfully mischievous mischievously thoughtful thoughtfully surprised amused confused embarrassed annoyed tired
tiredly enthusiastic enthusiastically dramatic dramatically deadpan monotone whispered whispering shouting
singing crying laughing sighing smiling slow slowly fast quickly aside breathless breathlessly jokingly teasing
teasingly
"""


def _forms(stems: str) -> Iterator[str]:
    """Third persons and participles of English verbs: what directions are written in."""
    for stem in stems.split():
        is_changed = stem.endswith("y") and stem[-2] not in "aeiou"
        yield f"{stem[:-1]}ies" if is_changed else f"{stem}{'es' if stem.endswith(('s', 'sh', 'ch')) else 's'}"
        yield f"{stem.removesuffix('e')}ing"
        yield f"{stem}{stem[-1]}ing"  # nodding


_ACTS = {*_forms(_STEMS), *_OTHERS.split()}
_WIDE_ACTS = {*_ACTS, *_forms(_WIDE_STEMS)}
LISTS: Mapping[str, Any] = {
    "acts": frozenset(_ACTS),
    "wide": frozenset(_WIDE_ACTS),
    "third": frozenset(each for each in _WIDE_ACTS if not each.endswith("ing")),
    "quiet": frozenset(f"{_SOUNDS}{_MANNERS}".split()),
    "alone": frozenset(("sigh", "gasp", "cough", "gulp", "yawn", "sniff", "groan", "giggle", "chuckle", "ahem")),
    "no_adverbs": frozenset(("only", "family", "early", "reply", "apply", "supply", "july", "italy", "really")),
}
"""Words of the patterns below."""
_NAMED = r"(?:clear(?:s|ing)|shak(?:es|ing)|tak(?:es|ing)|deep|long)\s(?:\w+\s){0,2}(?:throat|head|breath|pause)"
_OVER = r"(?![^\W_])"
"""Behind a whole word."""
_ADVERBS = rf"(?:(?!\L<no_adverbs>{_OVER})[a-z]+ly,?\s)*+"
_MORE = r"(?:[\s,…]+[^\W\d_]++(?:['’-][^\W\d_]++)*+)"
IN_BRACKETS = rf"{_ADVERBS}(?:{_NAMED}|\L<wide>{_OVER}{_MORE}{{0,7}}+|\L<quiet>{_OVER}{_MORE}{{0,2}}+)[\s…]*+"
_ALONE = r"\L<alone>(?=[)*_])"
IN_PARENTHESES = rf"{_ADVERBS}(?:{_NAMED}|{_ALONE}|\L<acts>{_OVER}{_MORE}{{0,4}}+)[\s…]*+"
"""Longer ones are remarks."""
_OTHER = rf"(?P<other>{_NAMED}|{_ALONE}|\L<wide>{_OVER}{_MORE}{{0,7}}+)"
IN_ASTERISKS = rf"{_ADVERBS}(?:\L<third>{_OVER}{_MORE}{{0,7}}+|{_OTHER})[\s…]*+"
