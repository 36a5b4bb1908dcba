"""Records what a real Artery tells, for stand-ins to play back: it made `exchange.xz` and `attacked.xz`
(and a stand-in with --note, playing that, `attacked.sums`).

    record.py OUT PROGRAM -f omnetpp.ini     in the place of PROGRAM, advpipe-artery (artery.program)
    record.py --compress OUT                 afterwards

It stands between the two: advpipe's port in omnetpp.ini becomes its own.
"""

from __future__ import annotations

import lzma
import re
import socket
import subprocess
import sys
import threading
from pathlib import Path

PORT = re.compile(r"(\*\.(?:traci\.nodes|stations)\.port = )(\d+)")


def record(out: Path, program: str, arguments: list[str]) -> int:
    ini = Path(arguments[arguments.index("-f") + 1])
    text = ini.read_text(encoding="utf-8")
    found = PORT.search(text)
    assert found is not None
    with socket.create_server(("127.0.0.1", 0)) as listener:
        ini.write_text(PORT.sub(rf"\g<1>{listener.getsockname()[1]}", text), encoding="utf-8")
        artery = subprocess.Popen([program, *arguments])
        module = listener.accept()[0]
    advpipe = socket.create_connection(("127.0.0.1", int(found.group(2))))
    threading.Thread(target=_answers, args=(advpipe, module), daemon=True).start()
    with module, advpipe, out.open("wb") as file:
        while data := module.recv(1 << 16):
            file.write(data)
            file.flush()  # advpipe ends this process without a warning
            advpipe.sendall(data)
    return artery.wait()


def _answers(advpipe: socket.socket, module: socket.socket) -> None:
    while data := advpipe.recv(1 << 16):
        module.sendall(data)


if sys.argv[1] == "--compress":
    written = Path(sys.argv[2])
    written.with_suffix(".xz").write_bytes(lzma.compress(written.read_bytes(), preset=9))
else:
    sys.exit(record(Path(sys.argv[1]), sys.argv[2], sys.argv[3:]))
