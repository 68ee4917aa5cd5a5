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
    "en": "uh-huh, mhm, mm-hmm, mm, hm, huh, uh, uhm, um, er, erm, ah, oh, ooh, aha, yes, yeah, yep, yup, aye, "
    "ok, okay, okey-dokey, right, all right, alright, sure, sure thing, for sure, of course, naturally, "
    "certainly, obviously, exactly, precisely, absolutely, definitely, totally, indeed, true, so true, correct, "
    "agreed, i agree, you're right, very, quite, pretty, that, that's, that is, it's, sounds, how, good, nice, "
    "fine, great, lovely, perfect, excellent, brilliant, awesome, amazing, wonderful, fantastic, beautiful, "
    "interesting, cool, funny, fair, fair enough, makes sense, good to know, wow, whoa, gosh, goodness, "
    "my goodness, oh my, my god, no way, no kidding, you don't say, really, is that so, i see, oh i see, i know, "
    "i understand, i get it, got it, gotcha, understood, go on, go ahead, carry on, keep going, continue, "
    "please continue, please go on, tell me more, i'm listening, haha, ha, hehe, heh, lol",
    "de": "ja, jaja, jo, joa, jep, jup, jawohl, jawoll, genau, ganz genau, ganz richtig, ist ja, ach nee, okay, "
    "ah, oh, äh, ähm, öh, aha, ach, ach so, achso, ach ja, ach komm, ach wirklich, mhm, hmhm, hm, stimmt, "
    "das stimmt, gut, klar, na klar, na gut, naja, na ja, verstehe, versteh, ich verstehe, verstanden, ich weiß, "
    "weiß ich, kapiert, richtig, sicher, bestimmt, natürlich, selbstverständlich, logisch, freilich, absolut, "
    "definitiv, auf jeden fall, einverstanden, in ordnung, passt, geht klar, das, das ist, sehr, wie, schön, "
    "wahr, toll, super, prima, perfekt, wunderbar, klasse, krass, cool, wow, interessant, spannend, lustig, echt, "
    "wirklich, tatsächlich, eben, alles klar, soso, so so, ach was, sag bloß, oje, oh je, meine güte, mein gott, "
    "du hast recht, da hast du recht, weiter, erzähl weiter, mach weiter, red weiter, sprich weiter, nur weiter, "
    "und weiter, ich höre, ich höre zu, haha, hihi, hehe",
    "fr": "oui, ouais, ouaip, d'accord, ah, ah bon, oh, bon, bien, hum, euh, mhm, ok, exact, exactement, "
    "tout à fait, absolument, effectivement, en effet, évidemment, carrément, voilà, je vois, je comprends, "
    "j'ai compris, compris, entendu, je sais, bien sûr, c'est ça, c'est vrai, c'est clair, c'est bien, "
    "c'est super, c'est génial, c'est intéressant, c'est marrant, vrai, vraiment, sérieux, sérieusement, "
    "sans blague, c'est pas vrai, pas possible, ça marche, super, génial, parfait, excellent, formidable, "
    "chouette, intéressant, marrant, drôle, cool, très, oh là là, mon dieu, la vache, si, je suis d'accord, "
    "tu as raison, vous avez raison, continue, continuez, vas-y, allez-y, raconte, racontez, je t'écoute, "
    "je vous écoute, haha, hihi, mdr, ben oui, bah oui, trop bien, mouais",
    "es": "sí, si, claro, vale, ajá, ya, bueno, bien, muy bien, mhm, eh, ah, oh, ay, uy, ok, okey, exacto, "
    "exactamente, efectivamente, eso, eso es, eso sí, así es, tal cual, correcto, cierto, es cierto, verdad, "
    "es verdad, de verdad, en serio, no me digas, entiendo, lo entiendo, te entiendo, comprendo, entendido, "
    "ya veo, lo sé, ya lo sé, de acuerdo, estoy de acuerdo, tienes razón, tiene razón, por supuesto, desde luego, "
    "sin duda, seguro, totalmente, genial, perfecto, estupendo, fantástico, maravilloso, guay, interesante, "
    "qué interesante, qué bien, qué bueno, qué guay, qué fuerte, qué risa, qué divertido, órale, vaya, madre mía, "
    "dios mío, sigue, siga, continúa, continúe, cuéntame, cuéntame más, dime, adelante, te escucho, jaja, jeje, "
    "jiji, uf, ah mira, qué curioso",
    "it": "sì, certo, certamente, va bene, ok, mhm, eh, ah, oh, aha, ah ecco, ecco, ho capito, capito, capisco, "
    "esatto, esattamente, già, giusto, appunto, infatti, bene, molto bene, bello, d'accordo, sono d'accordo, "
    "vero, è vero, davvero, sul serio, ma dai, dai, ma va, ovvio, ovviamente, naturalmente, assolutamente, "
    "perfetto, ottimo, fantastico, bellissimo, interessante, che bello, che interessante, che forte, incredibile, "
    "non ci credo, hai ragione, ha ragione, lo so, vedo, continua, continui, vai avanti, prego, dimmi, mi dica, "
    "racconta, ti ascolto, mamma mia, caspita, haha, ahah, eheh, ah beh, ma pensa, certo che sì",
    "pt": "sim, certo, pois, pois é, claro, tá, tá bom, tá certo, bem, muito bem, ok, mhm, uhum, aham, ah, oh, é, "
    "ah é, é mesmo, mesmo, é verdade, verdade, entendi, entendo, compreendo, percebo, exato, exatamente, isso, "
    "isso mesmo, correto, justo, sei, eu sei, sério, a sério, nossa, puxa, caramba, meu deus, uau, beleza, legal, "
    "que legal, bacana, fixe, que giro, que bom, ótimo, perfeito, maravilha, interessante, que interessante, "
    "com certeza, sem dúvida, claro que sim, concordo, tem razão, você tem razão, tens razão, continua, continue, "
    "pode continuar, conta, conta mais, estou ouvindo, haha, rs, k, que coisa, rsrs",
    "nl": "ja, jaja, jawel, jep, oké, ok, mhm, hm, ah, oh, aha, precies, klopt, dat klopt, juist, goed, "
    "heel goed, inderdaad, ik snap het, snap ik, ik begrijp het, begrijp ik, begrepen, duidelijk, natuurlijk, "
    "tuurlijk, zeker, uiteraard, waar, dat is waar, echt, echt waar, meen je dat, serieus, leuk, wat leuk, mooi, "
    "wat mooi, fijn, prachtig, geweldig, fantastisch, gaaf, grappig, interessant, je hebt gelijk, mee eens, "
    "ik weet het, weet ik, ga door, ga verder, ga je gang, vertel, vertel verder, ik luister, goh, jeetje, "
    "tjonge, wauw, haha, hihi, tja, wat grappig, mooi zo",
    "ru": "да, ага, угу, м, хм, а, о, ах, ох, ой, хорошо, очень хорошо, понятно, понял, поняла, понимаю, "
    "я понимаю, ясно, точно, конечно, верно, ладно, правда, да ладно, серьёзно, серьезно, разумеется, "
    "естественно, безусловно, именно, вот именно, так так, ну да, вот как, вот оно что, согласен, согласна, "
    "вы правы, ты прав, ты права, здорово, отлично, прекрасно, замечательно, интересно, как интересно, круто, "
    "класс, классно, забавно, ничего себе, надо же, не может быть, боже мой, ого, вау, знаю, я знаю, продолжай, "
    "продолжайте, рассказывай, рассказывайте, слушаю, я слушаю, ок, окей, ха, хаха, хехе, хихи, ну конечно, "
    "ух ты, так, вот это да",
    "ko": "네, 예, 응, 어, 음, 아, 오, 와, 우와, 그래, 그래요, 그렇군요, 그렇구나, 그렇죠, 그쵸, 그럼, 그럼요, "
    "맞아, 맞아요, 맞습니다, 맞죠, 알겠어, 알겠어요, 알겠습니다, 알았어, 알았어요, 아하, 진짜, 진짜요, 정말, "
    "정말요, 정말로, 좋아, 좋아요, 좋네요, 좋습니다, 대박, 헐, 물론, 물론이죠, 당연하지, 당연하죠, 오케이, 계속, "
    "계속해, 계속하세요, 말씀하세요, 그래서요, 이해해요, 이해했어요, 재미있네요, 재밌네요, 신기하네요, 멋져요, "
    "하하, 호호, 히히, 헤헤, ㅋ, ㅎ, 어머, 그렇습니까",
    "ja": "うん, はい, はーい, ええ, え, あ, あー, お, おー, おお, そう, そうですね, そうですよね, そうですか, "
    "そうなんだ, そうなんですか, そうなんですね, そうだね, そうだよね, そうか, そっか, へえ, へー, ほう, ほー, "
    "ふーん, ふうん, なるほど, なるほどね, なるほどですね, 確かに, たしかに, もちろん, 本当, 本当に, 本当ですか, "
    "ほんと, ほんとに, ほんとう, マジ, マジで, まじで, すごい, すごいですね, すごいね, 面白い, 面白いですね, "
    "おもしろい, いいね, いいですね, わかる, わかった, わかりました, 分かった, 分かりました, 了解, 了解です, "
    "オッケー, オーケー, どうぞ, 続けて, 続けてください, 笑, はは, ハハ, あはは, アハハ, わはは, ふふ, フフ, "
    "へへ, えへへ",
    "zh": "嗯, 哦, 噢, 喔, 啊, 呃, 唔, 哎呀, 哇, 哇塞, 天哪, 天啊, 我的天, 对, 对啊, 对呀, 对的, 没错, 是, 是啊, "
    "是呀, 是的, 是吗, 是这样, 是这样啊, 这样, 这样啊, 原来如此, 原来是这样, 好, 好的, 好啊, 好吧, 好嘞, 行, "
    "行吧, 可以, 当然, 确实, 的确, 真的, 真的吗, 真的啊, 真棒, 很棒, 太棒了, 太好了, 厉害, 真厉害, 不错, 有意思, "
    "很有意思, 有趣, 很有趣, 明白, 明白了, 我明白, 我明白了, 懂了, 我懂, 我懂了, 知道, 知道了, 我知道, 我知道了, "
    "了解, 理解, 我理解, 同意, 我同意, 有道理, 说得对, 你说得对, 难怪, 怪不得, 继续, 请继续, 你继续, 继续说, "
    "请说, 你说, 然后呢, 后来呢, 哈哈, 哈, 呵呵, 嘿嘿, 嘻嘻, 笑, 可不是, 可不是嘛, 天呐, 挺好的, 哎哟, 这么厉害",
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
