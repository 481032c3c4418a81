"""Rows of a pilot's results, for its JSON lines."""

import json


def say(row, path):
    """Prints a row as a line of JSON, and appends it to `path` if there is one."""
    line = json.dumps({k: round(float(v), 4) if isinstance(v, float) else v for k, v in row.items()})
    print(line, flush=True)
    if path:
        with open(path, "a") as file:
            file.write(line + "\n")
