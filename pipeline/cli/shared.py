"""Options that several commands share."""

from __future__ import annotations

from typing import Annotated

import typer

Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace an output that exists.")]
LidarTopic = Annotated[
    str | None, typer.Option("--lidar", help="Topic of the clouds, such as /ego/lidar/points, among several.")
]
Workers = Annotated[
    int | None, typer.Option("--workers", min=1, help="Processes.", show_default="one a core")
]
BaselineTries = Annotated[
    int | None,
    typer.Option(
        "--baseline-tries",
        min=1,
        help="Random tries of which the best one is scored too; 1: only one.",
        show_default="as many as the attack looked at",
    ),
]
Device = Annotated[
    str, typer.Option("--device", help="Where the detector computes: cpu, cuda, or cuda:N of several GPUs.")
]
DetectorName = Annotated[
    str, typer.Option("--detector", help="A shipped name, a .safetensors file, or module:Class.")
]
