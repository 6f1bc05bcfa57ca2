from os import PathLike
from typing import Any, Literal, Mapping, Sequence, TypedDict, final, overload

import numpy as np
import numpy.typing as npt

Vector = Sequence[float]
Picture = npt.NDArray[np.float32]
"""(height, width, 4), float32: red, green, blue, alpha; the top row first."""

ColorSpace = Literal["report", "linear"]
"""Display values, or linear radiance: see docs/color.md."""

Backend = Literal["cpu", "wgpu", "cuda", "optix"]

class CuritibaError(RuntimeError):
    """Raised if the renderer cannot do something. The message says what, where, what would be valid, and what to do."""

class Gpu(TypedDict):
    name: str
    kind: Literal["discrete GPU", "integrated GPU", "virtual GPU", "unknown kind", "software"]
    interface: str
    driver: str
    abilities: str

class BackendFacts(TypedDict):
    device: str | None
    missing: str | None

class Pass(TypedDict):
    name: str
    kind: Literal["raster", "rays", "effect", "quad", "intersections", "compute", "off"]
    program: str | None
    parameters: dict[str, str]

class Timing(TypedDict):
    step: str
    """load, build, upload, raster, maps, effect, read-back, join, rays, quad or write"""
    name: str
    """The pass, the scene or the file."""
    per_frame: bool
    host_ms: float
    """Median of all runs, milliseconds on the host with synchronisation."""
    device_ms: float | None
    """Median of all runs by the device's own clock, milliseconds; None if the step has no device time."""
    runs: int
    rays: int | None
    """Rays of one run."""
    mrays_per_second: float | None
    bytes: int
    note: str

class AccumulatedPass(TypedDict):
    # The keys are "pass", "batches", "error" and "standard_error". "pass" is a Python keyword, so it cannot be declared as a field.
    batches: int
    error: float
    standard_error: Picture

class Accumulated(TypedDict):
    image: Picture
    samples: int
    error: float
    passes: list[AccumulatedPass]

class Hits(TypedDict):
    t: npt.NDArray[np.float32]
    """(n,): distance in lengths of the direction; infinite where nothing is hit."""
    triangle: npt.NDArray[np.int32]
    """(n,): row of `indices`; -1 where nothing is hit."""
    uv: npt.NDArray[np.float32]
    """(n, 2): barycentric coordinates of the corners 1 and 2; NaN where nothing is hit."""

@final
class Renderer:
    """A project or scene, ready to be rendered; made by `open`.

    Setters are checked at once and take effect with the next picture. `render` then runs only the passes that depend on them; its
    picture equals, bit for bit, that of a renderer that was opened with these settings.
    """

    def render(self) -> Picture:
        """The picture (height, width, 4) with all current settings. The array owns the renderer's memory: nothing is copied for Python."""

    def frame(self) -> Picture:
        """The same picture as `render`, with every pass run again: for measurements."""

    def target(self, name: str) -> Picture:
        """A channel of a render target (height, width, 4), such as "pos" or "Deferred Render Targets::norm": a copy.

        Positions are in scene units with the light's cosine in the fourth channel; normals have unit length and 0 there. The first call for
        a channel that no pass reads draws the G-buffer again.
        """

    def accumulate(self, goal: int | float | str) -> Accumulated:
        """Takes more and more samples of the same sequence in the passes that sample.

        `goal`: an int for samples a point, "2s" or "500ms" for a time, a float below 1 for a standard error. In the result, "image" is the picture,
        "error" is the root mean square of the pixels' standard errors (an upper estimate: see docs/library.md), and "passes" has the error of each
        pass, with the standard error of each pixel.
        """

    def set_camera(self, name: str | None = None) -> None:
        """Lets every pass use this camera; if None, each uses its own."""

    def set_pose(
        self,
        camera: str,
        *,
        position: Vector | None = None,
        direction: Vector | None = None,
        look_at: Vector | None = None,
        up: Vector | None = None,
        fov: float | None = None,
    ) -> None:
        """Moves a camera; arguments that are not given stay unchanged. Scene units; `fov` is vertical, in degrees."""

    def set_light(self, light: str, direction: Vector, color: Vector) -> None:
        """Lets a light shine in the direction in which it travels, with a linear colour (red, green, blue)."""

    def set_size(self, width: int, height: int) -> None:
        """Sets the size of the window, pixels; render targets scale with it."""

    def set_parameter(self, pass_name: str, name: str, value: object) -> None:
        """Sets a parameter of a ray or effect pass, as `--set PASS.NAME=VALUE`; `curitiba list` names them."""

    def set_enabled(self, pass_name: str, enabled: bool) -> None:
        """Switches a pass off or on. A ray or effect pass that is off passes on the colour that it reads, or writes a share of light of 1."""

    def set_pixel_samples(self, samples: int | str) -> None:
        """Sets the number of samples per pixel, as `aa` of `open` does. The picture is their mean."""

    def set_seed(self, seed: int) -> None:
        """Sets the seed of the random numbers, 0 to 2^32 - 1."""

    def reload(self) -> None:
        """Reads the project and its scenes again with the next picture, and keeps the settings."""

    @overload
    def timings(self, *, as_frame: Literal[False] | None = None) -> list[Timing]: ...
    @overload
    def timings(self, *, as_frame: Literal[True, "pandas", "polars"]) -> Any: ...
    def timings(self, *, as_frame: bool | Literal["pandas", "polars"] | None = None) -> Any:
        """Every step so far, each as a dict: times in milliseconds, `rays` of one run, `bytes` of memory.

        With `as_frame=True` the result is a pandas.DataFrame, or a polars.DataFrame if pandas is not installed; "pandas" or
        "polars" asks for that library.
        """

    def forget_timings(self) -> None:
        """Forgets the times of all frames so far, so that frames after a warm-up are measured alone."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the window in pixels; the next picture has this size, or that of `crop`."""

    @property
    def color(self) -> ColorSpace:
        """The colour space of the pictures' numbers."""

    @property
    def cameras(self) -> list[str]:
        """Names of the cameras, as `set_camera` and `set_pose` take them."""

    @property
    def lights(self) -> list[str]:
        """Names of the lights, as `set_light` takes them."""

    @property
    def passes(self) -> list[Pass]:
        """The passes of the last picture, in order, with their parameters."""

    @property
    def passes_run(self) -> list[str]:
        """Names of the passes that ran for the last picture."""

    @property
    def engines(self) -> tuple[str, str]:
        """The raster engine and the ray backend, such as ("cpu", "cpu")."""

    @property
    def warnings(self) -> list[str]:
        """What was left out or replaced, and ray backends that failed."""

def open(
    path: str | PathLike[str],
    *,
    size: tuple[int, int] | None = None,
    camera: str | None = None,
    pipeline: str | None = None,
    backend: Literal["auto", "cpu", "wgpu", "cuda", "optix"] = "auto",
    raster: Literal["auto", "cpu", "wgpu"] = "auto",
    fidelity: Literal["corrected", "thesis"] = "corrected",
    seed: int = 0,
    parameters: Mapping[str, Any] | None = None,
    off: Sequence[str] = ...,
    max_memory: int = ...,
    effects: str | None = None,
    look_from: Vector | None = None,
    look_at: Vector | None = None,
    fov: float | None = None,
    sun: Vector | None = None,
    up: Literal["y", "z"] | None = None,
    background: Vector | None = None,
    color: ColorSpace | None = None,
    aa: int | str = 1,
    crop: tuple[int, int, int, int] | None = None,
    bands: int | None = None,
    fallback: Sequence[Backend] = ...,
    adapter: int | str | None = None,
    gpus: int | Literal["all"] | None = None,
) -> Renderer:
    """Opens a project file, a scene file (.glb, .gltf, .obj, .cbo, .nbo, .3ds, .mesh.xml) or a folder of scenes.

    `size` is (width, height) in pixels; `parameters` are those of passes, such as {"pass2.samples": 16}; `off` names passes that are
    switched off; `max_memory` is in bytes; `color` is the colour space: if None, the project's own, or "linear" for scene files. `aa` is the
    number of samples per pixel, 1, 2, 4, 8, 16, 32 or 64, whose mean is the picture. "16:0.02" traces rays for four of them, and for the others
    only where shadows, occlusion or glass differ by more than 0.02. `crop` is (column, row, width, height) in pixels from the top left: pictures
    then are (height, width, 4) of that part, equal to the same part of the whole. `bands`, 1 to 1024, renders the same picture in at most this
    many bands of rows, one after the other, in less memory; None takes as few as `max_memory` allows. `fallback` names ray backends that take
    over, in this order, if the one before fails; `Renderer.warnings` then says so. `adapter` is the device of wgpu, by its place in `gpus()` or
    a part of its name; `gpus` is the number of GPUs for cuda and optix, or "all". For scene files alone: `effects` such as "shadows+ao",
    `look_from` and `look_at` in scene units, `fov` in degrees, `sun` the direction in which it stands, `up` the axis that points up,
    `background` display values from 0 to 1.
    """

def gpus() -> list[Gpu]:
    """The devices that wgpu finds by Vulkan, Metal or DX12, the preferred one first, each as a dict. `open(adapter=…)` takes a position in this list
    or a part of a name. Empty where there is no driver.

    "name" and "driver" come from the driver. "kind" is "discrete GPU", "integrated GPU", "virtual GPU", "unknown kind" or "software", which is no
    GPU. "interface" is "vulkan", "metal" or "dx12". "abilities" says how large pictures (pixels) and scenes (MiB for each part) may be, and what
    the device lacks.
    """

def backends() -> dict[Backend, BackendFacts]:
    """The ray backends by name, each as a dict: "device" is its device, or None if it is not available; "missing" then says why.

    Names are those that `open(backend=…)` and `open(fallback=…)` take: "cpu", "wgpu", "cuda", "optix".
    """

def confine(folder: str | PathLike[str]) -> None:
    """From now on this package reads and writes no file outside the folder, wherever symbolic links lead. Use it for projects from strangers.

    This holds for the whole process and cannot be undone; Python's own files are not affected. Call it before `open`.
    """

def displayed(
    picture: npt.ArrayLike,
    *,
    color: ColorSpace = ...,
    exposure: float = ...,
    tone: Literal["none", "reinhard"] = ...,
) -> npt.NDArray[np.uint8]:
    """The content of a PNG of a picture (height, width, 3 or 4): (height, width, 4), 8 bits. `color` is the colour space of the picture's numbers.

    Linear radiance is multiplied by 2 to the power of `exposure`; then follow the tone curve and the transfer function of sRGB.
    """

def compare(
    test: npt.ArrayLike,
    reference: npt.ArrayLike,
    *,
    color: ColorSpace = ...,
    outlier_threshold: float = ...,
    pixels_per_degree: float = ...,
) -> dict[str, float]:
    """Compares a picture with a reference, both (height, width, 3 or 4): the metrics of `curitiba compare` by name. `color` is the colour space of
    their numbers; ssim and flip compare displayed values.

    The keys are rmse, relmse, max, psnr (decibels), ssim, flip, energy, outliers; and pixels, the number compared.
    """

@final
class Tracer:
    """Triangles that rays can be asked about: `positions` (n, 3) float32 in scene units, `indices` (m, 3) of corners.

    Watertight; both sides of a triangle are hit; results do not depend on the number of threads.
    """

    def __init__(self, positions: npt.ArrayLike, indices: npt.ArrayLike) -> None: ...
    def __len__(self) -> int:
        """Number of triangles."""

    @property
    def nbytes(self) -> int:
        """Bytes of the tree."""

    def closest(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        *,
        t_min: float | npt.ArrayLike = ...,
        t_max: float | npt.ArrayLike = ...,
    ) -> Hits:
        """The nearest hit of each ray with t_min < t < t_max.

        `origins` (n, 3), or (1, 3) for all rays, and `directions` (n, 3) of unit length (distances count in their lengths) are float32; other types
        are converted, which copies them. `t_min` and `t_max` are numbers or (n,); the defaults are 0 and infinity.
        """

    def occluded(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        *,
        t_min: float | npt.ArrayLike = ...,
        t_max: float | npt.ArrayLike = ...,
    ) -> npt.NDArray[np.bool_]:
        """(n,): whether anything lies on each ray. The arguments are those of `closest`."""

def visibility(
    positions: npt.ArrayLike,
    triangles: npt.ArrayLike,
    pairs: npt.ArrayLike,
    *,
    samples: int | None = None,
    error: float | None = None,
    facing: Literal["skip", "zero"] = "skip",
    form_factors: bool = False,
    seed: int = 0,
) -> dict[str, Any]:
    """Visibility between pairs of triangles: `positions` (n, 3), `triangles` (m, 3), `pairs` (k, 2) of triangles.

    "visibility" (k,) is the share of open segments between the two (NaN where no segment leaves the front of both), "error" (k,) its standard
    error, 0 where it is exact. "class" says how it was found, "samples" (k,) counts segments. `form_factors` adds "form_factors" and
    "form_factor_errors", both (k, 2): from the first to the second and back. `samples` (a multiple of 8) or `error` set the effort; the
    default is 64 samples.
    """
