"""Does what it is told, one operation a line, and says what the client saw.

A request is [operation, argument, ...] in JSON. The reply is {"seen": ...}, {"refused": ...} if the
client or the servo objects, or {"lost": ...} if the client got no answer in time.
"""

import json
import signal
import sys

# Nothing here takes that long unless the machine stands still.
PATIENCE_S = 20


class Lost(Exception):
    """No answer in time."""


def serve(operations):
    for line in sys.stdin:
        signal.alarm(PATIENCE_S)
        name, *arguments = json.loads(line)
        try:
            reply = {"seen": operations[name](*arguments)}
        except Lost as cause:
            reply = {"lost": str(cause) or "no answer"}
        except Exception as cause:
            reply = {"refused": f"{type(cause).__name__}: {cause}"}
        signal.alarm(0)
        print(json.dumps(reply, default=list), flush=True)
