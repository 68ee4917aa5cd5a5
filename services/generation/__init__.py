"""Engagement generation: makes blocks with connection events of turn fragments, and decides where the head looks.

`references` chooses words and gestures, `block` times them and the looks of a turn, `turns` follows the turn, `head`
decides where to look when no fragment does. Thesis, chapter 3.
"""
