"""Curitiba: rasterisation and ray tracing in one deferred pipeline, for notebooks and scripts.

>>> import curitiba
>>> renderer = curitiba.open("xml_projects/SceneFinal.xml", size=(512, 512))
>>> picture = renderer.render()                    # (512, 512, 4) float32
>>> renderer.set_parameter("pass2", "samples", 16)
>>> picture = renderer.render()                    # runs the ray pass again, not the G-buffer

Every function that may take long releases the interpreter, can be interrupted with Ctrl-C, and after a second shows how far it is
(`set_progress`). Lengths are in scene units, rows of
pictures count from the top. Colours are what `Renderer.color` says: "report", display values, or "linear", linear radiance.
"""

from ._native import (
    CuritibaError,
    Renderer,
    Tracer,
    backends,
    compare,
    confine,
    displayed,
    gpus,
    open,
    visibility,
)
from ._progress import set_progress

__all__ = [
    "CuritibaError",
    "Renderer",
    "Tracer",
    "backends",
    "compare",
    "confine",
    "displayed",
    "gpus",
    "open",
    "set_progress",
    "visibility",
]
