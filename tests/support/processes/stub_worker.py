"""A worker that misbehaves on request; tests run it in a subprocess."""

import os
import signal
import time

from planners.whole_path.subprocess_worker import serve


def answer(request: str) -> object:
    match request:
        case "crash":
            os.kill(os.getpid(), signal.SIGSEGV)
        case "hang":
            time.sleep(600.0)
        case "fail":
            raise ValueError("no such thing")
        case "print":
            os.write(1, b"noise\n")
    return request, os.getpid()


if __name__ == "__main__":
    serve(answer)
