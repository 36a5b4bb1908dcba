import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from advpipe.pipeline.core.index_ranges import index_ranges


@given(st.lists(st.tuples(st.integers(-9, 9), st.integers(0, 5))))
def test_ranges_follow_each_other(ranges):
    starts, counts = np.array(ranges, np.int64).reshape(-1, 2).T
    expected = [index for start, count in ranges for index in range(start, start + count)]
    assert index_ranges(starts, counts).tolist() == expected
