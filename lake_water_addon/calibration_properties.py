# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a scene keeps its calibration: what each setting cost and what error it left, as it was measured.

`calibration.py` fills and reads `scene.lake_water.calibration`.
"""

import bpy
from bpy.props import (
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    IntVectorProperty,
    StringProperty,
)

UNKNOWN = -1.0
"""An error that could not be measured."""

MEASURES = {
    "PIXELS": ("Pixels", "How far what is seen in the water lies from its true place in the picture"),
    "FLIP": ("FLIP", "How different the picture looks from the best that this technique can do, 0 to 1"),
}
"""The errors that a front can be made of: label and description by key."""


def _chosen(self: "LakeWaterCalibration", context: bpy.types.Context) -> None:
    from . import calibration, calibration_plot

    if 0 <= self.chosen < len(self.points):
        calibration.apply_point(self.id_data, self.points[self.chosen])
        calibration_plot.mark_choice(self.id_data)


class LakeWaterCalibrationPoint(bpy.types.PropertyGroup):
    """One combination of settings, measured. Errors are UNKNOWN where there was nothing to measure."""

    settings: StringProperty(
        name="Settings",
        description="By name, as JSON: those of the picture, its samples, those of the technique alone",
    )
    seconds: FloatProperty(
        name="Time", description="Of one picture with all its samples, in seconds", subtype="TIME_ABSOLUTE"
    )
    metres: FloatProperty(
        name="Metres",
        description="Median distance between where the refracted ray of a pixel was taken to end and where "
        "it does",
    )
    texels: FloatProperty(
        name="Texels", description="The same distance in texels of the technique's own texture"
    )
    pixels: FloatProperty(
        name="Pixels",
        description="Mean distance in the picture between what is seen in the water, and mirrored by it, and "
        "its true place, each as far as it makes up the color, and half a texel",
    )
    flip: FloatProperty(
        name="FLIP",
        description="Mean difference on the water, as an eye sees it, to the best that the technique can do",
    )


class LakeWaterCalibration(bpy.types.PropertyGroup):
    """What was measured on a scene, on which machine, in which view. Empty before the first calibration."""

    points: CollectionProperty(
        type=LakeWaterCalibrationPoint, name="Points", description="All that was measured, in that order"
    )
    chosen: IntProperty(
        name="Chosen",
        description="The point whose settings were taken. Click one to take its settings",
        default=-1,
        min=-1,
        options=set(),
        update=_chosen,
    )
    measure: EnumProperty(
        name="Error",
        description="The error by which points are compared",
        items=[(key, *texts) for key, texts in MEASURES.items()],
        default="PIXELS",
        options=set(),
    )
    technique: StringProperty(name="Technique", description="Key of the technique that was measured")
    resolution: IntVectorProperty(
        name="Resolution", description="Width and height of the picture in pixels", size=2
    )
    view: StringProperty(name="View", description="What was looked through: the 3D view or a camera's name")
    device: StringProperty(name="Device", description="What drew it, as its driver calls itself")
    date: StringProperty(name="Date", description="When it was measured, local time")
    signature: StringProperty(
        name="Signature", description="Of the waters that were measured, to tell whether they have changed"
    )


CLASSES = (LakeWaterCalibrationPoint, LakeWaterCalibration)
