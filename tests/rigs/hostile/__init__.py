"""Attacks on services, bodies and clients, for their tests: in memory and in virtual time only.

`trial` runs an attack on the services that it is given, and reports what went wrong. What is sent is made by pure
files: random messages of every type (`typed`, `payloads`, `markup`), requests at bad moments (`schemes`), and the
reports of a body that lies (`lies`). `audit` judges the answers. docs/hostile.md tells how to use it.
"""
