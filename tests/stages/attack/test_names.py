"""The names read from the source are those of the classes, without the time to import these."""

from __future__ import annotations

import subprocess
import sys

from advpipe.stages.attack.names import attack_names
from advpipe.stages.attack.registry import ATTACKS


def test_they_are_those_of_the_registry() -> None:
    assert attack_names() == sorted(ATTACKS)


def test_shells_get_them_without_torch() -> None:
    script = (
        "import sys; from advpipe.pipeline.cli.completion import attack_names; "
        "print(attack_names('detac'), *({'torch', 'numpy'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "['detach']\n"
