"""Engagement generation: turn fragments become blocks with connection events; who owns the head. Thesis 3."""
