"""The engines that draw inputs: hypothesis, randomly; atheris, guided by the code coverage of earlier
inputs."""

from __future__ import annotations

import importlib.util
import os
import random
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from itertools import count
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis.strategies import SearchStrategy

from tests.fuzz.case import Case

ENGINES = ("hypothesis", "atheris")
BATCH = 200
"""Inputs that hypothesis draws before it begins anew: it remembers all that it drew."""

SETTINGS = settings(
    max_examples=BATCH,
    database=None,
    deadline=None,
    phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
    print_blob=False,
)
FIRST_INPUTS = 40
LONGEST_BYTES = 4096
"""Of what libFuzzer changes, from which hypothesis draws an input."""

LIBFUZZER = (
    *(
        "-rss_limit_mb=0",
        "-malloc_limit_mb=0",
        "-timeout=86400",
        "-print_final_stats=0",
        "-use_value_profile=0",
    ),
    *(
        f"-handle_{name}=0"
        for name in ("abrt", "bus", "fpe", "ill", "int", "segv", "term", "usr1", "usr2", "xfsz")
    ),
)


class Enough(BaseException):
    """The requested number of inputs was tried; not an Exception, so that hypothesis does not catch it."""


def has_atheris() -> bool:
    return importlib.util.find_spec("atheris") is not None


def instrumented(engine: str) -> AbstractContextManager[object]:
    """A context in which imports of advpipe are instrumented for atheris."""
    if engine != "atheris":
        return nullcontext()
    import atheris

    return atheris.instrument_imports(include=["advpipe"])


def explore(
    cases: SearchStrategy[Case], attempt: Callable[[Case], None], number: int, first_batch: int,
    on_batch: Callable[[int], None],
) -> None:  # fmt: skip
    """Draws inputs until `attempt` raises `Enough`; the same ones for a seed `number` and batch."""
    for batch in count(first_batch):
        on_batch(batch)
        seed(f"{number}/{batch}")(SETTINGS(given(cases)(attempt)))()


def explore_guided(
    cases: SearchStrategy[Case], attempt: Callable[[Case], None], number: int, corpus: Path
) -> None:
    """The same under atheris, which keeps in `corpus` what reached new code; never returns."""
    import atheris

    corpus.mkdir(parents=True, exist_ok=True)
    if not any(corpus.iterdir()):
        draws = random.Random(number)
        for index in range(FIRST_INPUTS):
            (corpus / f"first-{index}").write_bytes(draws.randbytes(draws.choice([128, 512, LONGEST_BYTES])))

    def one(case: Case) -> None:
        try:
            attempt(case)
        except Enough:  # which libFuzzer would take for a crash
            sys.stdout.flush()
            os._exit(0)

    drawn = SETTINGS(given(cases)(one))
    options = [f"-seed={number % 2**31 + 1}", f"-max_len={LONGEST_BYTES}", *LIBFUZZER]
    options += [f"-artifact_prefix={corpus.parent}/", str(corpus)]
    atheris.Setup([sys.argv[0], *options], drawn.hypothesis.fuzz_one_input)
    atheris.Fuzz()
