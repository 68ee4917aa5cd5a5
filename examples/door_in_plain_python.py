"""Drives a robot through its door with Python's own `http.client`, on Python 2.7 as well, as on a NAO.

    python door_in_plain_python.py 127.0.0.1 8138 door-tokens/manager

says a turn, prints what became of it, and then each word of the next turn as it is said.
"""

import json
import sys

try:
    from http.client import HTTPConnection
except ImportError:  # Python 2
    from httplib import HTTPConnection

HOST, PORT = sys.argv[1], int(sys.argv[2])
with open(sys.argv[3]) as token:
    HEADERS = {"Authorization": "Bearer " + token.read().strip(), "Content-Type": "application/json"}


def ask(method, path, body=None):
    """Send a request, and return what the door answers."""
    connection = HTTPConnection(HOST, PORT)
    connection.request(method, path, None if body is None else json.dumps(body), HEADERS)
    answer = json.loads(connection.getresponse().read().decode("utf-8"))
    connection.close()
    if "fault" in answer:
        raise SystemExit(json.dumps(answer["fault"]))
    return answer


def line_of(stream):
    """Read a line of what the door tells as it comes: Python 2 has no `readline` for it."""
    line = b""
    while not line.endswith(b"\n"):
        byte = stream.read(1)
        if not byte:
            raise SystemExit("the door has closed")
        line += byte
    return line.strip()


def turn(*parts):
    """Make a turn of words, and of references to objects by their ids."""
    return {"turn_status": "full", "parts": list(parts)}


objects = [each["id"] for each in ask("GET", "/v1/world?timeout=10")["entities"] if each["kind"] == "object"]
told = ask("POST", "/v1/turn", turn({"say": "Please take"}, {"refer": objects[0]}))
print(json.dumps({"status": told["status"], "said": told["said"]}, sort_keys=True))

news = HTTPConnection(HOST, PORT)
news.request("GET", "/v1/news?only=words", None, HEADERS)
lines = news.getresponse()
told = ask("POST", "/v1/turn", turn({"say": "Thank you."}))
left = len(told["said"].split())
while left:
    line = line_of(lines)
    if line:  # an empty one says that the link still stands
        print(json.loads(line.decode("utf-8"))["word"])
        left -= 1
