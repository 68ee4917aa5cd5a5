"""Engagement generation: makes blocks with connection events of turn fragments, and decides where the head looks.

Thesis, chapter 3.
"""
