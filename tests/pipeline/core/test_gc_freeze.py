import gc

import pytest

from advpipe.pipeline.core.gc_freeze import gc_frozen


def test_existing_objects_are_frozen_only_within_the_block() -> None:
    before = gc.get_freeze_count()
    with gc_frozen():
        assert gc.get_freeze_count() > before + 1000
    assert gc.get_freeze_count() == 0


def test_collections_are_rarer_only_within_the_block() -> None:
    usual = gc.get_threshold()
    with gc_frozen():
        assert gc.get_threshold()[0] > 10 * usual[0]
        assert gc.get_threshold()[1:] == usual[1:]
    assert gc.get_threshold() == usual


def test_objects_are_unfrozen_when_the_block_fails() -> None:
    with pytest.raises(ZeroDivisionError), gc_frozen():
        1 / 0  # noqa: B018
    assert gc.get_freeze_count() == 0


def test_new_garbage_is_still_collected() -> None:
    class Loop:
        found = 0

        def __init__(self) -> None:
            self.itself = self

        def __del__(self) -> None:
            Loop.found += 1

    with gc_frozen():
        Loop()
        gc.collect()
        assert Loop.found == 1
