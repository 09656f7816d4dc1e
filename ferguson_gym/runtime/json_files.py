"""JSON documents of users, read with errors that say what is wrong with the file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any


def read_json(path: Path) -> Any:
    """What a JSON file holds; a byte order mark, which some programs write, is skipped.

    Raises:
        ValueError: not text, not JSON, nested too deeply, or a whole number of thousands of digits;
            the message does not name the file.
        OSError: the file cannot be read.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8-sig"))
    except UnicodeDecodeError as error:
        raise ValueError(f"not a text file: {error}") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"not JSON: {error}") from None
    except RecursionError:
        raise ValueError("lists and objects are nested too deeply to be read") from None
    except ValueError:
        raise ValueError("a whole number has more digits than can be read") from None
