"""The picture of OVITO in ``docs/how-to/looking-at-results.md``:
``python docs/generate/with_ovito.py FILE.gsd``.

FILE.gsd is what ``multicor export gsd runs/floor`` wrote of the tutorial's run
(``docs/tutorial/heat.md``). Needs OVITO's Python module (``pip install ovito pillow``; 3.17 wants a
display and a Vulkan driver, on a machine without: Xvfb and Mesa's).
"""

import sys
from pathlib import Path

from ovito.io import import_file
from ovito.modifiers import ColorCodingModifier, ComputePropertyModifier
from ovito.qt_compat import QtCore
from ovito.vis import BondsVis, ColorLegendOverlay, OpenGLRenderer, ParticlesVis, Viewport
from PIL import Image

TARGET = Path(__file__).parents[1] / "pictures" / "ovito.png"


def main() -> None:
    """Draw the last frame."""
    pipeline = import_file(sys.argv[1])
    temperature = ColorCodingModifier(property="temperature", gradient=ColorCodingModifier.Magma())
    temperature.start_value, temperature.end_value = 273.15, 393.15
    pipeline.modifiers.append(temperature)
    # m
    width = ComputePropertyModifier(
        operate_on="bonds", output_property="Width", expressions=["0.16 * normal_force"]
    )
    pipeline.modifiers.append(width)
    last = pipeline.source.num_frames - 1
    data = pipeline.compute(last)
    data.particles.vis.shape = ParticlesVis.Shape.Circle
    bonds = data.particles.bonds.vis
    bonds.coloring_mode, bonds.color, bonds.shading = (
        BondsVis.ColoringMode.Uniform,
        (1.0, 1.0, 1.0),
        BondsVis.Shading.Normal,
    )
    data.cell.vis.enabled = False
    pipeline.add_to_scene()

    view = Viewport(type=Viewport.Type.Top)
    place = data.particles.positions[...]
    low, high = place.min(axis=0), place.max(axis=0)
    view.camera_pos = tuple((low + high) / 2.0 + (0.1 * (high - low)[0], 0.0, 0.0))
    view.fov = 0.52 * (high - low)[1]
    legend = ColorLegendOverlay(
        modifier=temperature, title="temperature in K   ", rotate_title=True, format_string="%.0f  "
    )
    legend.orientation, legend.legend_size, legend.aspect_ratio = (
        QtCore.Qt.Orientation.Vertical,
        0.5,
        14.0,
    )
    legend.alignment = QtCore.Qt.AlignmentFlag.AlignRight | QtCore.Qt.AlignmentFlag.AlignVCenter
    legend.font_size, legend.offset_x, legend.text_color = 0.06, -0.04, (1.0, 1.0, 1.0)
    legend.ticks_enabled, legend.ticks_spacing = True, 20.0
    view.overlays.append(legend)
    view.render_image(
        filename=str(TARGET),
        size=(1400, 1000),
        frame=last,
        background=(0.32, 0.34, 0.43),
        renderer=OpenGLRenderer(),
    )
    with Image.open(TARGET) as image:
        image.convert("RGB").quantize(
            160, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE
        ).save(TARGET, optimize=True)


if __name__ == "__main__":
    main()
