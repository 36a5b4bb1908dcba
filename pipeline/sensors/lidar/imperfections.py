"""What sets a real LiDAR apart from an ideal one: a section of its own in the LiDAR's section."""

from __future__ import annotations

from pydantic import Field

from advpipe.pipeline.core.section import NotNegative, Section, Switch


class Imperfections(Section):
    """One key an effect; 0 or false turns it off. They act in worlds that cast rays, not in CARLA."""

    relief: Switch = Field(
        True, description="surfaces are as rough as the world says: plaster, bricks, asphalt, grass"
    )
    texture: Switch = Field(
        True, description="reflectivity varies over a surface as the world says: stains, patches, cracks"
    )
    gloss: Switch = Field(
        True, description="glossy surfaces such as paint return most light only near their normal"
    )
    weak_noise_m: NotNegative = Field(
        0.064,
        le=1.0,
        description="standard deviation of the range in metres of a return as strong as the noise; it falls "
        "with the root of the signal (LISA: 0.09 / sqrt 2)",
    )
    beam_divergence_deg: NotNegative = Field(
        0.18,
        le=2.0,
        description="full angle of the beam: it mixes ranges at edges of objects, and blurs the range of "
        "surfaces at grazing incidence",
    )
    blooming_deg: NotNegative = Field(
        0.35,
        le=2.0,
        description="angle from a retroreflector up to which its light outshines the ray's own target",
    )
    ring_elevation_stddev_deg: NotNegative = Field(
        0.02, le=0.5, description="fixed error of each ring's elevation, drawn from the seed"
    )
    ring_range_stddev_m: NotNegative = Field(
        0.01, le=0.2, description="fixed error of each ring's range in metres, drawn from the seed"
    )
    patchy_losses: Switch = Field(
        True, description="lost returns come in patches of neighbouring rays; their share stays the same"
    )
    own_body: Switch = Field(
        True, description="the body of the sensor's own vehicle shades the world and returns light"
    )


IDEAL = Imperfections(
    relief=False,
    texture=False,
    gloss=False,
    weak_noise_m=0.0,
    beam_divergence_deg=0.0,
    blooming_deg=0.0,
    ring_elevation_stddev_deg=0.0,
    ring_range_stddev_m=0.0,
    patchy_losses=False,
    own_body=False,
)
"""A sensor without any of them."""
