"""The ray caster's twin: the same scene photographed by Blender's Cycles (Book: Blender).

Blender runs in this process, on the processor, as the module ``bpy``; it is imported by the
first call that needs it. Each call starts it from its factory settings and leaves it empty, so
calls do not depend on one another, and a Blender scene of your own in this process is lost.
Where Blender does not run, those that use it raise an ImportError that says why.
"""

from fpputil.optics.blender.drawing import picture, sheets
from fpputil.optics.blender.twin import photograph, see, stored

__all__ = ["photograph", "picture", "see", "sheets", "stored"]
