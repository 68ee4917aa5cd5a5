"""A peer that means harm, for the tests of services, bodies and clients: in memory and in virtual time only.

`trial` runs it against services that are given to it, and says what came of it. What it sends is made by pure files:
random messages of every type (`typed`, `payloads`, `markup`), requests at bad moments (`schemes`), and the reports of
a body that lies (`lies`). `audit` judges what was answered. docs/hostile.md tells how to use it.
"""
