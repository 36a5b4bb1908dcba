"""Added points stand in the cloud where the sensor would have written them, not at its end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.scan_order import places_in_scan, scan_keys, scan_order_of
from advpipe.pipeline.messages.cloud import Cloud, chosen_points, joined_clouds
from advpipe.stages.attack.lidar.base import LidarResult


def in_scan_order(clean: Cloud, result: LidarResult) -> LidarResult:
    """A valid result of an attack on a clean cloud (N,), with its added points in the order of the scan."""
    is_added = result.labels.is_added
    count = int(is_added.sum())
    if not count:
        return result
    kept, added = result.cloud[:-count], result.cloud[-count:]
    order = scan_order_of(clean)
    survives = np.ones(len(clean), bool)
    survives[result.labels.point[result.labels.is_removed]] = False
    before = np.append(0, np.cumsum(survives))[places_in_scan(clean, added, order)]
    row = np.lexsort((scan_keys(added, order), before))
    attacked = result.labels.places(len(clean)).copy()
    is_moved = (attacked >= 0) & ~is_added
    attacked[is_moved] += np.searchsorted(before[row], attacked[is_moved], side="right")
    attacked[np.flatnonzero(is_added)[row]] = before[row] + np.arange(count)
    cloud = _inserted(kept, before[row], chosen_points(added, row))
    return replace(result, cloud=cloud, labels=replace(result.labels, attacked=attacked))


def _inserted(cloud: Cloud, before: npt.NDArray[np.int64], added: Cloud) -> Cloud:
    """A cloud (N,) with added points (K,), each before the point of that index, which ascend."""
    is_own = np.ones(len(cloud) + len(added), bool)
    is_own[before + np.arange(len(added))] = False
    source = np.empty(len(is_own), np.int64)
    source[is_own], source[~is_own] = np.arange(len(cloud)), len(cloud) + np.arange(len(added))
    return chosen_points(joined_clouds(cloud, added), source)
