"""Whom and what the head looks at: maintenance and response policy, inhibitions, and who of them wins."""
