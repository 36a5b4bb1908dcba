"""Keys on a terminal that a test holds."""

import os
import pty
import subprocess
import sys
import time

SCRIPT = """
import sys
from advpipe.stages.play.keyboard import Keyboard
with Keyboard() as keyboard:
    print(keyboard.is_there, flush=True)
    print(repr(keyboard.wait(20)), repr(keyboard.wait(20)), repr(keyboard.wait(0.01)), flush=True)
"""


def test_keys_come_without_enter_and_the_terminal_is_as_before() -> None:
    """In a session of its own, whose terminal it is."""
    import termios

    ours, theirs = pty.openpty()
    before = termios.tcgetattr(theirs)
    claim = "import fcntl, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0)"
    with subprocess.Popen(
        [sys.executable, "-c", claim + SCRIPT],
        stdin=theirs,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "True\n"
        assert termios.tcgetattr(theirs) != before
        os.write(ours, b" q")
        assert child.stdout.readline() == "' ' 'q' ''\n"
        child.wait(20)
        assert termios.tcgetattr(theirs) == before
    os.close(ours)
    os.close(theirs)


def test_without_a_terminal_no_key_comes() -> None:
    begin_s = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT.replace("20", "0.1")], stdin=subprocess.DEVNULL, capture_output=True
    )
    assert done.stdout.decode() == "False\n'' '' ''\n"
    assert time.monotonic() - begin_s > 0.2


def test_a_terminal_of_another_session_is_left_alone() -> None:
    ours, theirs = pty.openpty()
    command = [sys.executable, "-c", SCRIPT.replace("20", "0.1")]
    done = subprocess.run(command, stdin=theirs, capture_output=True, text=True, start_new_session=True)
    os.close(ours)
    os.close(theirs)
    assert done.stdout == "False\n'' '' ''\n", done.stderr
