"""Carries out in ParaView what ``docs/how-to/looking-at-results.md`` says; made
``docs/pictures/paraview.png``.

In a directory where the tutorial's ``runs/floor`` is (``docs/tutorial/heat.md``)::

    paraview --script=…/docs/generate/with_paraview.py

with ParaView 5.12 or later. For the picture its window filled a virtual screen (``Xvfb :7 -screen 0
1400x860x24`` and a window manager that maximizes windows and gives them no frame), the panels on
the left were made wider, ``gaussian`` was typed into the search field, and
``DISPLAY=:7 import -window root paraview.png`` of ImageMagick took it.
"""

from paraview.simple import (
    CellDatatoPointData,
    ColorBy,
    ExtractSurface,
    GetActiveViewOrCreate,
    GetAnimationScene,
    GetColorTransferFunction,
    GetScalarBar,
    OpenDataFile,
    RenameSource,
    Render,
    SetActiveSource,
    Show,
    Shrink,
    Tube,
    UpdatePipeline,
)

view = GetActiveViewOrCreate("RenderView")
run = OpenDataFile("runs/floor/results.vtkhdf")
RenameSource("results.vtkhdf", run)
frames = GetAnimationScene()
frames.UpdateAnimationUsingDataTimeSteps()
frames.GoToLast()

grains = Show(run, view)
grains.SetRepresentationType("Point Gaussian")
grains.GaussianRadius = 1.0
grains.ShaderPreset = "Plain circle"
grains.ScaleByArray = True
grains.SetScaleArray = ["POINTS", "radius"]
grains.UseScaleFunction = False
ColorBy(grains, ("POINTS", "temperature"))
colors = GetColorTransferFunction("temperature")
colors.ApplyPreset("Inferno (matplotlib)", True)
colors.RescaleTransferFunction(273.15, 393.15)
bar = GetScalarBar(colors, view)
bar.Title, bar.ComponentTitle = "temperature in K", ""
bar.TitleFontSize, bar.LabelFontSize = 20, 20
bar.AutomaticLabelFormat, bar.LabelFormat, bar.RangeLabelFormat = False, "%.0f", "%.0f"
bar.WindowLocation, bar.Position, bar.ScalarBarLength = "Any Location", [0.9, 0.25], 0.5
bar.Visibility = True

apart = Shrink(registrationName="Shrink1", Input=run, ShrinkFactor=1.0)
lines = ExtractSurface(registrationName="ExtractSurface1", Input=apart)
forces = CellDatatoPointData(registrationName="CellDatatoPointData1", Input=lines)
UpdatePipeline(time=run.TimestepValues[-1], proxy=forces)
tube = Tube(registrationName="Tube1", Input=forces, Scalars=["POINTS", "normal_impulse"])
tube.VaryRadius, tube.Radius, tube.RadiusFactor = "By Scalar", 1e-6, 250.0
network = Show(tube, view)
network.ColorArrayName = [None, ""]
network.DiffuseColor = network.AmbientColor = [1.0, 1.0, 1.0]

view.InteractionMode = "2D"
Render()
view.ResetCamera()
view.CameraParallelScale *= 0.7
SetActiveSource(run)
Render()
