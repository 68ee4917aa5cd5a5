"""A model leads a conversation, with a tool of ours: `.venv/bin/python examples/conversation.py MODEL [ENDPOINT]`.

MODEL is `openai:NAME`, `anthropic:NAME`, `ollama:NAME`, or the address of a server that speaks as OpenAI's does.
"""

import asyncio
import sys

from engage_hri import Conversation, connect


async def weather(city: str) -> str:
    """Tell the weather of a city."""
    return f"Sun in {city}, 21 degrees."


async def main(model: str, *endpoints: str) -> None:
    async with connect(connect=endpoints) as robot, Conversation(robot, model, tools=[weather]) as talk:
        async for entry in talk.entries():
            print(entry)


if __name__ == "__main__":
    asyncio.run(main(*sys.argv[1:]))
