"""Patterns of marks and of stage directions: what the reader of `marks.py` looks for.

The marks are those of CommonMark, GitHub and HTML. Each pattern is to end with something that shows its end, so that
a text which still comes may match in part.

Stage directions are words that say what a speaker does while speaking, and that are not to be said: models write
`[laughs]`, `(sighs)` and `*waves*`. What stands there is a direction if its first word, adverbs aside, is an act of
the list below. In brackets more words are: sounds and manners, for no sentence has them in brackets. So `*very*` is
an emphasis, `(looks like rain)` a remark, and `[sic]` a word.
"""

import unicodedata
from collections.abc import Iterator, Mapping
from typing import Any

from engage_hri.schemas.text import UNSPACED

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


THOUGHTS = frozenset({"think", "thinking", "thought", "thoughts", "reasoning", "reflection", "scratchpad"})
"""Elements in which models think, so that what is in them is not meant for the person."""
_BLOCKS = """
address article aside blockquote body br dd details div dl dt figure figcaption footer form h1 h2 h3 h4 h5 h6 head
header hr html li main nav ol p pre section summary table tbody td tfoot th thead tr ul speak break paragraph
sentence title
"""
BLOCKS = frozenset(_BLOCKS.split())
"""Elements that separate the words before and after them."""

_LETTER = r"[^\W_]"
_ATTRIBUTE = r"\s+[A-Za-z_:][\w:-]*(?:\s*=\s*(?:\"[^\"]*\"|'[^']*'|[^\s\"'=<>`]+))?"
TAG = rf"</?(?P<name>[A-Za-z][\w-]*(?::[A-Za-z_][\w-]*)?)(?:{_ATTRIBUTE})*\s*/?>"
"""With a prefix as XML has it: `<tel:112>` and `<https://x.org>` are addresses."""
_HIDES = rf"(?i)<(?:[\w-]+:)?(?P<hidden>script|style|template|svg|math|tool_call|function_call)(?:{_ATTRIBUTE})*\s*>"
HIDDEN = rf"{_HIDES}(?:[^<]++|<(?!/(?:[\w-]+:)?(?P=hidden)\s*>))*+</[^>]*>"
"""An element of which the content is not said. Without its end it is a tag, and the words behind it are said."""
TOKEN = r"<\|[\w-]{1,40}\|>"
"""Tokens that steer a model, and that it has let slip: `<|im_end|>`."""
COMMENT = r"<(?:!--[\s\S]*?--|!\[CDATA\[[\s\S]*?\]\]|\?[\s\S]*?\?|![A-Za-z][^>]*)>"
AUTOLINK = r"<(?P<address>[A-Za-z][A-Za-z0-9+.-]{1,31}:[^\s<>]*|[\w.+-]+@[\w-]+(?:\.[\w-]+)+)>"
_NO_ADDRESS, _STOPS = r"\s<>\[\]*`|{}\"", ".,;:!?'_~&"
ADDRESS = (
    rf"(?i)(?<![\w@.])(?P<address>(?:(?:https?|ftps?|file|mailto|tel):(?://)?(?=[\w+/])|(?=www\.\w))"
    rf"(?:[^{_NO_ADDRESS}()]|\([^{_NO_ADDRESS}()]*\))+(?<![{_STOPS}]))"
    rf"(?=[{_STOPS}]*(?:[{_NO_ADDRESS})]|\([^{_NO_ADDRESS}()]*+[{_NO_ADDRESS}(]))"
)
"""With brackets in it that are closed: `https://x.org/a_(b)`, but `(see https://x.org)`."""
HOST = r"(?i)(?:[a-z]+:/*)?(?:[^/@\s]*@)?(?:www\.)?(?P<host>[^/?#:\s]*)"
ENTITY = r"&(?:[A-Za-z][A-Za-z0-9]{1,31}|#[0-9]{1,7}|#[xX][0-9A-Fa-f]{1,6});"
_TITLE = r"(?:\"[^\"]*\"|'[^']*'|\([^()]*\))"
_LINK = rf"\(\s*(?:<[^<>\n]*>|(?!<)(?:[^\s()]|\([^\s()]*\))*)(?:\s+{_TITLE})?\s*\)"
LINK = rf"\]{_LINK}"
_CLOSED = r"\([^\s()]*\)"
ADDRESSED = rf"(?:\((?:[^\s()]|{_CLOSED})*\)|(?=[^(]|\((?:[^\s()]|{_CLOSED})*(?:\s|\([^\s()]*[\s(])))"
"""Behind a reference: the address of a link, or what shows that there is none."""
LABEL = r"\]\[[^\[\]\n]{0,80}\]"
_LABEL = r"\[(?P<label>[^\[\]\n^][^\[\]\n]{0,79})\]"
_DESTINATION = r"(?:<[^<>\n]*>|(?=[^\s<]*(?:[:/#]|\.\w))[^\s<]\S*)"
DEFINITION = rf"(?<=\n){_LABEL}:[ \t]*{_DESTINATION}(?:[ \t]+{_TITLE})?[ \t]*(?=\n)"
"""Of a link, with what looks like an address: `[Robot]: Hello.` is words."""
INDEX = rf"(?<=(?![{UNSPACED}])\w)"
"""Behind a name, where a bracket is an index: `array[0]`."""
_NO_INDEX = rf"(?!{INDEX})"
TASK = r"\[[xX ]\](?=\s)"
_FOOTNOTE = r"\[\^[^\s\[\]]+\]"
FOOTNOTE = rf"(?<=\n){_FOOTNOTE}:|{_FOOTNOTE}(?=[^:])|(?<!\n){_FOOTNOTE}"
_NUMBER = r"[1-9]\d{0,2}"
_NUMBERS = rf"\[{_NUMBER}(?:\s*[,;–-]\s*{_NUMBER})*\]"
CITATION = rf"{_NO_INDEX}(?P<told>{_NUMBERS})(?:{_LINK}|(?=[^(:\d]|:\s)|(?=\([^)\n]*\)))"
IMAGE = rf"(?<!{_LETTER})!(?=\[)"
SOURCE = r"【\d+(?::\d+)?†[^】\n]{0,80}】"
IN_SQUARE = rf"(?i){_NO_INDEX}\[{IN_BRACKETS}\](?=[^(])"
IN_ROUND = rf"(?i)(?<!{_LETTER})\({IN_PARENTHESES}\)"
IN_STARS = (
    rf"(?i)(?<!{_LETTER})(?P<mark>[*_]){IN_ASTERISKS}(?P=mark)(?=[.,!…]|\s+(?:(?P<small>(?-i:\p{{Ll}}))|\S)|\s*\n)"
)
"""Before a small letter it is one only with a verb in the third person: `*Looking* at it` is an emphasis."""
_UNSAID = rf"{CITATION}|{FOOTNOTE}|{SOURCE}|{IN_SQUARE}|{IN_ROUND}"
BEFORE_UNSAID = rf"(?<=\w)[ ]+(?=(?:[ ]*(?:{_UNSAID}))+[.,;:!?…])"
"""A blank that would be left between a word and its full stop."""
SIGN = (
    rf"(?<=\s)\*{{1,2}}(?=\s)|(?<={_LETTER})_+(?={_LETTER})|(?<=\))\*{{1,2}}(?=\()|(?<=\d)\*{{1,2}}(?={_LETTER})"
    rf"|(?<={_LETTER})\*{{1,2}}(?=\d)|(?<=[\W_]{_LETTER})\*{{1,2}}(?={_LETTER})"
)
"""Asterisks and underscores that are signs: between operands, and within names."""
CODE = r"(?P<run>`+)(?!`)(?P<code>(?:[^`\n]+|\n(?![ \t]*\n)|(?!(?P=run)(?!`))`+)*+)(?P=run)(?=[^`])"
ROWS = r"\|(?:[ \t]*+:?-++:?[ \t]*+\|)++(?=[ \t]*+:?+(?:[^-]|-++:?+[ \t]*+[^|]))"
"""A line between rows within a line, for XML makes one line of a table. No cell follows."""
FENCE = r"(?P<fence>`{3,}(?=[^`\n]*\n)|~{3,})[^\n]*\n"
RULE = r"[-_*=:|][-_*=:| \t]*(?=\n)"
"""A line without words: under a heading, between paragraphs, or between rows of a table."""
HEADING = r"#{1,6}(?=[ \t\n])"
HEADING_ENDS = r"(?<=[ \t])#+[ \t]*(?=\n)"
BULLET = r"[-+*](?=\s)"
NUMBER = r"(?P<number>\d{1,9})[.)](?=\s)"
PLAIN = r"[^\W_ℹ\ufe0f\u20e3]+|[,;:'.?\"/%$+)}={-]+"
PUNCTUATION = r"[!-/:-@\[-`{-~【]"
"""Characters with which a mark may begin, and that a backslash makes words."""

_SILENT = frozenset(("So", "Sk", "Cf", "Cs", "Co", "Cn", "Cc"))
"""Categories of characters that are not given to an engine: emoji, which it would read out by name, and controls."""
_SAID = frozenset("♭♮°℃℉\u200c\u200d№℠™®©")
"""Of these, and said: flats, units, and joiners that belong to the spelling of Persian and of Indian scripts."""
_SILENT_TOO = frozenset("ℹ\ufe0f\u20e3")
"""What makes an emoji of the character before it, and a letter that is mostly one."""


def is_silent(character: str) -> bool:
    """Tell whether a character is an emoji, or has no sound for another reason."""
    if character.isascii():
        return not character.isprintable()
    if character in _SILENT_TOO:
        return True
    return character not in _SAID and unicodedata.category(character) in _SILENT
