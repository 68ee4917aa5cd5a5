"""Pieces of a task, seen on a table: from pictures to the world. docs/pieces.md."""
