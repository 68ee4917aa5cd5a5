"""Words by language with which a person asks for nothing: those of listeners, who say "go on", and thanks. Pure data.

A list for each language, because length alone misjudges both ways: "stop" is as short as "yes", and "yes, yes, okay"
is as long as a question. "No" is in none of them: it may mean stop. Nor are words with which one begins to speak,
such as "well" and "but", nor thanks, with which one ends. What is part of many phrases stands alone: "that's".
"""

import re
from collections.abc import Mapping
from functools import lru_cache
from unicodedata import normalize

TEXTS_KEPT = 64
"""Number of texts of which is remembered what they are: the words of a speech are judged at each step of the talk."""
BY_LANGUAGE = {
    "en": "uh-huh, mhm, mm-hmm, mm, hm, huh, uh, uhm, um, er, erm, ah, oh, ooh, aha, yes, yeah, yep, yup, aye, ok, "
    "okay, okey-dokey, right, all right, alright, sure, sure thing, for sure, of course, naturally, "
    "certainly, obviously, exactly, precisely, absolutely, definitely, totally, indeed, true, so true, "
    "correct, agreed, i agree, you're right, very, quite, pretty, that, that's, that is, it's, sounds, how, "
    "good, nice, fine, great, lovely, perfect, excellent, brilliant, awesome, amazing, wonderful, fantastic, "
    "beautiful, interesting, cool, funny, fair, fair enough, makes sense, good to know, wow, whoa, gosh, "
    "goodness, my goodness, oh my, my god, no way, no kidding, you don't say, really, is that so, i see, oh i "
    "see, i know, i understand, i get it, got it, gotcha, understood, go on, go ahead, carry on, keep going, "
    "continue, please continue, please go on, tell me more, i'm listening, haha, ha, hehe, heh, lol",
    "de": "ja, jaja, jo, joa, jep, jup, jawohl, jawoll, genau, ganz genau, ganz richtig, ist ja, ach nee, okay, "
    "ah, oh, äh, ähm, öh, aha, ach, ach so, achso, ach ja, ach komm, ach wirklich, mhm, hmhm, hm, stimmt, "
    "das stimmt, gut, klar, na klar, na gut, naja, na ja, verstehe, versteh, ich verstehe, verstanden, "
    "ich weiß, weiß ich, kapiert, richtig, sicher, bestimmt, natürlich, selbstverständlich, logisch, freilich, "
    "absolut, definitiv, auf jeden fall, einverstanden, in ordnung, passt, geht klar, das, das ist, sehr, wie, "
    "schön, wahr, toll, super, prima, perfekt, wunderbar, klasse, krass, cool, wow, interessant, spannend, "
    "lustig, echt, wirklich, tatsächlich, eben, alles klar, soso, so so, ach was, sag bloß, oje, oh je, "
    "meine güte, mein gott, du hast recht, da hast du recht, weiter, erzähl weiter, mach weiter, red weiter, "
    "sprich weiter, nur weiter, und weiter, ich höre, ich höre zu, haha, hihi, hehe",
    "fr": "oui, ouais, d'accord, ah, ah bon, bon, bien, hum, exact, exactement, voilà, je vois, bien sûr, c'est ça",
    "es": "sí, claro, vale, ajá, ya, bueno, bien, exacto, entiendo, ya veo, de acuerdo, por supuesto",
    "it": "sì, certo, va bene, ho capito, capisco, esatto, già, bene, bello, d'accordo",
    "pt": "sim, certo, pois, pois é, claro, tá, tá bom, bem, entendi, exato",
    "nl": "ja, oké, precies, klopt, juist, goed, inderdaad, ik snap het, natuurlijk, tuurlijk",
    "ru": "да, ага, угу, хорошо, понятно, ясно, точно, конечно, верно, ладно",
    "ja": "うん, はい, はーい, ええ, え, あ, あー, お, おー, おお, そう, そうですね, そうですよね, そうですか, "
    "そうなんだ, そうなんですか, そうなんですね, そうだね, そうだよね, そうか, そっか, へえ, へー, ほう, ほー, "
    "ふーん, ふうん, なるほど, なるほどね, なるほどですね, 確かに, たしかに, もちろん, 本当, 本当に, "
    "本当ですか, ほんと, ほんとに, ほんとう, マジ, マジで, まじで, すごい, すごいですね, すごいね, 面白い, "
    "面白いですね, おもしろい, いいね, いいですね, わかる, わかった, わかりました, 分かった, 分かりました, "
    "了解, 了解です, オッケー, オーケー, どうぞ, 続けて, 続けてください, 笑, はは, ハハ, あはは, アハハ, "
    "わはは, ふふ, フフ, へへ, えへへ",
    "zh": "嗯, 对, 好, 是, 哦, 好的, 是的, 对对, 啊",
}  # fmt: skip
"""Phrases of each language, with commas between them."""

THANKS_BY_LANGUAGE = {
    "en": "thanks, thank you, thank you kindly, many thanks, thx, ta, cheers, a lot, a bunch, so much, very much, "
    "much appreciated, appreciate it, i appreciate it, no problem, never mind, well, well then, okay then, "
    "all right then, right then, good then, fine then, for that, for your help, you've been very helpful, "
    "that helps, that helped, that was helpful, helpful, it does, that does, that works, of you",
    "de": "danke, danke schön, dankeschön, danke sehr, danke dir, danke ihnen, vielen dank, besten dank, "
    "herzlichen dank, ich danke dir, ich danke ihnen, merci, na dann, also dann, gut dann, okay dann, nett, "
    "von dir, von ihnen, das hilft, das hilft mir, das war hilfreich, hilfreich, für die hilfe, für deine hilfe",
    "fr": "merci, merci beaucoup, merci bien, super, parfait, génial, c'est gentil, très bien, c'est bon",
    "es": "gracias, muchas gracias, mil gracias, muy amable, muy bien, perfecto, genial, qué bien, qué bueno",
    "it": "grazie, grazie mille, molte grazie, tante grazie, perfetto, ottimo, molto bene, molto gentile",
    "pt": "obrigado, obrigada, muito obrigado, muito obrigada, muito bem, muito bom, perfeito, ótimo",
    "nl": "bedankt, dank je, dank je wel, dankjewel, dank u, dank u wel, hartelijk bedankt, fijn, mooi, top",
    "ru": "спасибо, большое спасибо, спасибо большое, благодарю, отлично, прекрасно, очень хорошо",
    "ja": "ありがとう, ありがとうございます, ありがとうございました, どうも, 助かります, 助かりました, "
    "ね, です, ですね",
    "zh": "谢谢, 谢谢你, 谢谢您, 多谢, 感谢, 非常好, 太好了, 很好",
}  # fmt: skip
"""What people say besides when an answer is enough for them, in the same form."""


@lru_cache(TEXTS_KEPT)
def is_listening(text: str) -> bool:
    """True if the text has words, and all of them are those of a listener, in whatever language and how often."""
    said = _plain(text)
    return bool(said) and _LISTENER.fullmatch(said) is not None


@lru_cache(TEXTS_KEPT)
def is_content(text: str) -> bool:
    """True if the text has words, and all of them say that an answer is enough: a listener's, or thanks."""
    said = _plain(text)
    return bool(said) and _CONTENT.fullmatch(said) is not None


@lru_cache(TEXTS_KEPT)
def says_words(text: str) -> bool:
    """True if somebody has said a word; a recognizer writes noises as signs or in brackets: "..." or "[laughter]"."""
    return bool(_plain(text))


def plain_words(text: str) -> list[str]:
    """Split a text into words by which two recognizers' spellings of it are compared. What is in brackets is none."""
    return _plain(text).split()


def _plain(text: str) -> str:
    """Lower case, one blank between words, no signs, no letter twice in a row, no syllable more often than twice.

    "Hmm, mm-hmm!" is "hm m hm", "hahahaha" is "haha". What stands in brackets is no word: "(coughs) yes" is "yes".
    """
    said = normalize("NFKC", text).casefold().replace("’", "'")
    said = re.sub(r"\[[^]]*\]|\([^)]*\)|\*[^*]*\*|<[^>]*>|【[^】]*】", " ", said)
    said = re.sub(r"(\w)\1+", r"\1", " ".join(re.findall(r"\w+", said)))
    return re.sub(r"\b(\w{2,3})\1+(\w?)\b", r"\1\1", said)


def _pattern(*languages: Mapping[str, str]) -> re.Pattern[str]:
    told = [each for phrases in languages for each in phrases.values()]
    phrases = sorted({_plain(each) for lines in told for each in lines.split(",")}, key=len, reverse=True)
    # A syllable alone is part of any word: "あ" and "お" are a listener's, and "あお" is blue.
    is_joined = {each: each[0] >= "\u3400" or (each[0] >= "\u3000" and len(each) > 1) for each in phrases}
    spaced = "|".join(re.escape(each) for each in phrases if not is_joined[each])
    joined = "|".join(re.escape(each) for each in phrases if is_joined[each])
    unit = rf"(?:{spaced}|(?:{joined})+)"
    return re.compile(rf"{unit}(?: {unit})*")


_LISTENER, _CONTENT = _pattern(BY_LANGUAGE), _pattern(BY_LANGUAGE, THANKS_BY_LANGUAGE)
