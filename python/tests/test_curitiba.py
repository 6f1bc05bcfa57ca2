"""The wheel, as it is installed."""

import ast
import inspect
import json
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import curitiba

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROJECTS = ROOT / "xml_projects"
SMALL = {"size": (112, 80), "backend": "cpu", "raster": "cpu"}


def opened(name, **settings):
    return curitiba.open(PROJECTS / f"{name}.xml", **{**SMALL, **settings})


def test_it_is_the_wheel():
    assert "site-packages" in curitiba.__file__
    assert pathlib.Path(curitiba.__file__).with_name("py.typed").exists()


def parameters(function):
    names = [argument.arg for argument in (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)]
    return [name for name in names if name != "self"]


def test_the_stubs_have_the_names_and_parameters_of_the_module():
    native = curitiba._native
    stub = ast.parse(pathlib.Path(native.__file__).with_name("_native.pyi").read_text())
    classes = {node.name: node for node in stub.body if isinstance(node, ast.ClassDef)}
    functions = {node.name: node for node in stub.body if isinstance(node, ast.FunctionDef)}
    assert inspect.getdoc(native.Renderer) == ast.get_docstring(classes["Renderer"])
    assert inspect.getdoc(native.Tracer) == ast.get_docstring(classes["Tracer"])
    public = {name for name in dir(native) if not name.startswith("_")}
    assert public == set(curitiba.__all__) - {"set_progress"} == {*functions, "Renderer", "Tracer", "CuritibaError"}
    for name, function in functions.items():
        assert parameters(function) == list(inspect.signature(getattr(native, name)).parameters), name
        assert inspect.getdoc(getattr(native, name)) == ast.get_docstring(function), f"what help({name}) prints"
    for name in ("Renderer", "Tracer"):
        of_stub = {node.name: node for node in classes[name].body if isinstance(node, ast.FunctionDef)}
        of_class = {member for member in vars(getattr(native, name)) if not member.startswith("__") or member == "__len__"}
        assert of_class == set(of_stub) - {"__init__"}, name
        for member in of_class - {"__len__"}:
            real = getattr(getattr(native, name), member)
            assert inspect.getdoc(real) and inspect.getdoc(real) == ast.get_docstring(of_stub[member]), f"what help({member}) prints"
            if callable(real):
                found = [p for p in inspect.signature(real).parameters if p != "self"]
                assert parameters(of_stub[member]) == found, member


def test_a_picture_is_an_array_that_owns_its_memory():
    renderer = opened("SceneShadows")
    picture = renderer.render()
    assert picture.shape == (80, 112, 4) and picture.dtype == np.float32
    assert picture.flags.c_contiguous and picture.flags.writeable and np.isfinite(picture).all()
    assert len(np.unique(picture.reshape(-1, 4), axis=0)) > 100
    kept = picture.copy()
    picture[:] = 0
    assert (renderer.render() == kept).all(), "the renderer has its own picture"
    assert renderer.engines == ("cpu", "cpu") and renderer.size == (112, 80)
    assert renderer.cameras == ["MainCamera", "Vidro"] and renderer.lights == ["Sun"]


def test_scenes_are_linear_and_displayed_as_the_program_writes_them(tmp_path):
    scene = PROJECTS / "glass/scenes/balls.gltf"
    assert opened("SceneShadows").color == "report" and opened("SceneShadows", color="linear").color == "linear"
    settings = {**SMALL, "up": "y", "background": (0.2, 0.4, 0.8), "parameters": {"pass2.samples": 4}}
    linear, report = curitiba.open(scene, **settings), curitiba.open(scene, **settings, color="report")
    assert (linear.color, report.color) == ("linear", "report")
    sky = (51, 102, 204, 255)
    for renderer in (linear, report):
        shown = curitiba.displayed(renderer.render(), color=renderer.color)
        assert shown.shape == (80, 112, 4) and shown.dtype == np.uint8 and tuple(shown[0, 0]) == sky
    picture = linear.render()
    brighter = curitiba.displayed(picture, color="linear", exposure=1.0)
    assert (brighter == curitiba.displayed(2 * picture * (1, 1, 1, 0.5), color="linear")).all()
    toned = curitiba.displayed(picture, color="linear", tone="reinhard")
    assert toned.mean() < brighter.mean()
    # FLIP compares displayed values: the same numbers in another colour space are another picture.
    assert curitiba.compare(brighter / 255.0, curitiba.displayed(picture, color="linear") / 255.0)["flip"] == pytest.approx(
        curitiba.compare(2 * picture, picture, color="linear")["flip"], abs=0.01
    )
    assert curitiba.compare(2 * picture, picture)["flip"] != curitiba.compare(2 * picture, picture, color="linear")["flip"]
    turned = curitiba.open(scene, **{**settings, "up": "z"}).render()
    assert np.abs(turned - picture).max() > 0.1
    for wrong in ({"color": "srgb"}, {"exposure": 1.0}, {"color": "linear", "exposure": 65.0}, {"color": "linear", "tone": "aces"}):
        with pytest.raises(ValueError):
            curitiba.displayed(picture, **wrong)
    with pytest.raises(ValueError, match="y, z"):
        curitiba.open(scene, up="x")
    averaged = curitiba.open(scene, **settings, aa=4).render()
    assert 0 < np.abs(averaged - picture).mean() < 0.05
    with pytest.raises(ValueError, match="1, 2, 4, 8"):
        curitiba.open(scene, aa=9)


def test_setters_equal_a_renderer_that_was_opened_so():
    renderer = opened("SceneSSAO", parameters={"pass2.samples": 4})
    renderer.render()
    assert renderer.passes_run == ["pass1", "pass2", "pass5"]
    renderer.set_parameter("pass2", "radius", 2.5)
    changed = renderer.render()
    assert renderer.passes_run == ["pass2", "pass5"], "the G-buffer stays"
    assert (changed == opened("SceneSSAO", parameters={"pass2.samples": 4, "pass2.radius": 2.5}).render()).all()
    renderer.set_camera("Vidro")
    renderer.set_size(61, 43)
    expected = opened("SceneSSAO", parameters={"pass2.samples": 4, "pass2.radius": 2.5}, camera="Vidro", size=(61, 43))
    assert (renderer.render() == expected.render()).all()
    assert renderer.passes[1]["parameters"]["radius"] == "2.5" and renderer.passes[1]["program"] == "ssao"
    renderer.set_enabled("pass2", False)
    plain = opened("SceneNoEffects", camera="Vidro", size=(61, 43)).render()
    assert (renderer.render() == plain).all()
    assert [facts["kind"] for facts in renderer.passes] == ["raster", "off", "quad"]
    renderer.set_pixel_samples(4)
    averaged = opened("SceneNoEffects", camera="Vidro", size=(61, 43), aa=4).render()
    assert (renderer.render() == averaged).all() and not (averaged == plain).all()
    renderer.set_pixel_samples(1)
    renderer.set_enabled("pass2", True)
    renderer.set_seed(3)
    renderer.set_light("Sun", (-0.5, -1, 0.25), (1, 1, 1))
    renderer.set_camera()
    renderer.set_pose("MainCamera", position=(0, 5, -30), look_at=(0, 0, 0), fov=50)
    renderer.reload()
    assert (renderer.render() == renderer.frame()).all()


def test_targets_are_what_passes_read():
    renderer = opened("SceneFinal", parameters={"pass2.samples": 4})
    before = renderer.render()
    position, normal = renderer.target("pos"), renderer.target("Deferred Render Targets::norm")
    seen = np.any(normal[..., :3] != 0, axis=-1)
    assert position.shape == normal.shape == (80, 112, 4) and 0.3 < seen.mean() <= 1
    assert np.allclose(np.linalg.norm(normal[seen][:, :3], axis=1), 1, atol=1e-2)
    assert (renderer.render() == before).all()
    with pytest.raises(curitiba.CuritibaError, match="did you mean `norm`"):
        renderer.target("nrm")


def test_timings_are_rows():
    renderer = opened("SceneShadows")
    renderer.render()
    rows = renderer.timings()
    rays = [row for row in rows if row["step"] == "rays"]
    assert len(rays) == 1 and rays[0]["name"] == "pass2" and rays[0]["rays"] > 0 and rays[0]["host_ms"] > 0
    assert json.loads(json.dumps(rows)) == rows
    with pytest.raises(ValueError, match="pandas, polars"):
        renderer.timings(as_frame="excel")
    renderer.forget_timings()
    assert not any(row["per_frame"] for row in renderer.timings())


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_timings_are_a_table_of_the_library_that_is_there(library, monkeypatch):
    tables = pytest.importorskip(library)
    renderer = opened("SceneShadows")
    renderer.render()
    rows = renderer.timings()
    other = {"pandas": "polars", "polars": "pandas"}[library]
    # A module entry of None stands for a module that is not installed.
    monkeypatch.setitem(sys.modules, other, None)
    for table in (renderer.timings(as_frame=True), renderer.timings(as_frame=library)):
        assert isinstance(table, tables.DataFrame) and list(table.columns) == list(rows[0])
        assert list(table["step"]) == [row["step"] for row in rows] and list(table["host_ms"]) == [row["host_ms"] for row in rows]
    with pytest.raises(ModuleNotFoundError, match=f"{other} is not installed"):
        renderer.timings(as_frame=other)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(ModuleNotFoundError, match="neither pandas nor polars is installed"):
        renderer.timings(as_frame=True)


def test_accumulated_samples_are_those_of_one_frame():
    renderer = opened("SceneSSAO", parameters={"pass2.samples": 4})
    found = renderer.accumulate(64)
    expected = opened("SceneSSAO", parameters={"pass2.samples": 64}).render()
    assert (found["image"] == expected).all() and found["samples"] == 64
    assert 0 < found["error"] < 0.1 and found["passes"][0]["pass"] == "pass2"
    assert found["passes"][0]["standard_error"].shape == (80, 112, 4)
    assert renderer.accumulate(0.05)["error"] <= 0.05
    assert renderer.accumulate("1ms")["samples"] >= 32
    with pytest.raises(ValueError, match="500ms"):
        renderer.accumulate("for ever")


def test_errors_say_what_is_valid():
    with pytest.raises(curitiba.CuritibaError, match="nowhere.xml"):
        curitiba.open("nowhere.xml")
    with pytest.raises(ValueError, match="did you mean `cpu`"):
        opened("SceneShadows", backend="cpx")
    renderer = opened("SceneShadows")
    before = renderer.render()
    for wrong in (
        lambda: renderer.set_camera("Vidra"),
        lambda: renderer.set_parameter("pass2", "samples", 4),
        lambda: renderer.set_size(0, 4),
        lambda: renderer.set_pixel_samples(3),
        lambda: renderer.set_enabled("pass1", False),
        lambda: renderer.set_light("Sun", (0, 0, 0), (1, 1, 1)),
    ):
        with pytest.raises(ValueError):
            wrong()
    assert (renderer.render() == before).all()


def test_a_crop_and_bands_are_the_same_pixels():
    whole = opened("SceneShadows").render()
    cropped = opened("SceneShadows", crop=(17, 9, 40, 30))
    assert (cropped.render() == whole[9:39, 17:57]).all() and cropped.size == (112, 80)
    assert (cropped.target("pos") == opened("SceneShadows").target("pos")[9:39, 17:57]).all()
    banded = opened("SceneShadows", bands=3)
    assert (banded.render() == whole).all()
    with pytest.raises(curitiba.CuritibaError, match="rendered in bands"):
        banded.target("pos")
    for wrong, message in (
        ({"crop": (100, 0, 40, 30)}, "100,0,40x30 does not lie in the window of 112 x 80 pixels"),
        ({"crop": (0, 0, 0, 30)}, "at least one pixel"),
        ({"max_memory": 1000}, "max-memory"),
    ):
        with pytest.raises(curitiba.CuritibaError, match=message):
            opened("SceneShadows", **wrong)
    with pytest.raises(ValueError, match="1 to 1024"):
        opened("SceneShadows", bands=0)


def test_backends_and_gpus_are_those_of_the_machine():
    backends = curitiba.backends()
    assert list(backends) == ["cpu", "wgpu", "cuda", "optix"]
    assert backends["cpu"]["missing"] is None and "threads" in backends["cpu"]["device"]
    for facts in backends.values():
        assert (facts["device"] is None) != (facts["missing"] is None)
    gpus = curitiba.gpus()
    if not gpus:
        assert backends["wgpu"]["device"] is None
        with pytest.raises(ValueError, match="there is none on this machine"):
            opened("SceneShadows", adapter=0)
        return
    assert gpus[0]["name"] and gpus[0]["interface"] in ("vulkan", "metal", "dx12") and "pixels" in gpus[0]["abilities"]
    renderer = opened("SceneShadows", raster="wgpu", adapter=0)
    picture = renderer.render()
    assert renderer.engines == ("wgpu", "cpu")
    assert curitiba.compare(picture, opened("SceneShadows").render())["rmse"] < 0.02
    with pytest.raises(ValueError, match=f"there is no adapter {len(gpus)}"):
        opened("SceneShadows", adapter=len(gpus))


def test_a_fallback_takes_over_and_says_so():
    missing = [name for name, facts in curitiba.backends().items() if facts["device"] is None]
    if not missing:
        pytest.skip("every ray backend is there")
    with pytest.raises(curitiba.CuritibaError, match=missing[0]):
        opened("SceneShadows", backend=missing[0])
    renderer = opened("SceneShadows", backend=missing[0], fallback=[missing[0], "cpu", "cpu"])
    assert renderer.engines[1] == "cpu" and any(missing[0] in warning for warning in renderer.warnings)
    assert (renderer.render() == opened("SceneShadows").render()).all()
    with pytest.raises(ValueError, match="did you mean `cpu`"):
        opened("SceneShadows", fallback=["cpx"])
    with pytest.raises(ValueError, match="1 to 255, or all"):
        opened("SceneShadows", gpus=0)


def test_files_outside_a_folder_are_refused_once_it_is_set():
    # This runs in a process of its own, because it cannot be undone.
    code = """
import sys, curitiba
inside, outside = sys.argv[1:]
settings = {"size": (16, 12), "backend": "cpu", "raster": "cpu"}
curitiba.open(outside, **settings)
curitiba.confine(inside)
try:
    curitiba.open(outside, **settings)
except curitiba.CuritibaError as error:
    print(error)
try:
    curitiba.confine("nowhere")
except ValueError as error:
    print(error)
"""
    arguments = [sys.executable, "-c", code, str(ROOT / "python"), str(PROJECTS / "SceneShadows.xml")]
    run = subprocess.run(arguments, capture_output=True, text=True, check=True)
    refused, wrong = run.stdout.strip().splitlines()[0], run.stdout.strip().splitlines()[-1]
    assert "SceneShadows.xml" in refused and "outside" in run.stdout and "confine: nowhere" in wrong


def test_own_shaders_in_glsl_are_drawn():
    if not curitiba.gpus():
        pytest.skip("no device was found by wgpu")
    renderer = curitiba.open(PROJECTS / "shaders/Compute.xml", size=(96, 64))
    picture = renderer.render()
    assert renderer.engines[0] == "wgpu" and len(np.unique(picture.reshape(-1, 4), axis=0)) > 50


def test_pictures_are_compared():
    reference = np.full((32, 40, 4), 0.5, np.float32)
    test = reference.copy()
    test[..., :3] += 0.25
    found = curitiba.compare(test, reference)
    assert found["rmse"] == pytest.approx(0.25) and found["max"] == pytest.approx(0.25) and found["energy"] == pytest.approx(1.5)
    assert found["psnr"] == pytest.approx(20 * np.log10(4)) and found["outliers"] == 1 and found["pixels"] == 32 * 40
    same = curitiba.compare(reference[..., :3], reference.astype(np.float64))
    assert same["rmse"] == 0 and same["flip"] == 0 and same["ssim"] == 1
    with pytest.raises(curitiba.CuritibaError, match="one size"):
        curitiba.compare(test[1:], reference)
    with pytest.raises(ValueError, match="height, width, 3"):
        curitiba.compare(test[..., 0], reference)


def cube():
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))])


def slabs(origins, directions):
    """Where rays enter or leave the unit cube, in f64."""
    with np.errstate(divide="ignore", invalid="ignore"):
        near, far = (0 - origins) / directions, (1 - origins) / directions
    low, high = np.minimum(near, far).max(1), np.maximum(near, far).min(1)
    return np.where((low < high) & (high > 0), np.where(low > 0, low, high), np.inf)


def test_rays_hit_a_cube_where_slabs_say():
    random = np.random.default_rng(5)
    tracer = curitiba.Tracer(*cube())
    assert len(tracer) == 12 and tracer.nbytes > 0
    origins = random.uniform(-1, 2, (20_000, 3)).astype(np.float32)
    directions = random.normal(size=(20_000, 3))
    directions = (directions / np.linalg.norm(directions, axis=1, keepdims=True)).astype(np.float32)
    expected = slabs(origins.astype(np.float64), directions.astype(np.float64))
    hits = tracer.closest(origins, directions)
    assert hits["t"].dtype == np.float32 and hits["triangle"].dtype == np.int32 and hits["uv"].shape == (20_000, 2)
    hit = np.isfinite(hits["t"])
    # A ray that meets the cube within rounding of an edge may be reported either way.
    assert np.count_nonzero(hit != np.isfinite(expected)) <= 2 and 0.05 < hit.mean() < 0.9
    both = hit & np.isfinite(expected)
    assert np.allclose(hits["t"][both], expected[both], rtol=1e-4, atol=1e-5)
    assert (hits["triangle"][~hit] == -1).all() and np.isnan(hits["uv"][~hit]).all()
    corners, triangles = cube()
    a, b, c = (corners[triangles[hits["triangle"][hit]][:, i]].astype(np.float64) for i in range(3))
    u, v = (hits["uv"][hit][:, i, None].astype(np.float64) for i in range(2))
    points = origins[hit] + hits["t"][hit][:, None].astype(np.float64) * directions[hit]
    assert np.abs((1 - u - v) * a + u * b + v * c - points).max() < 1e-4
    assert (tracer.occluded(origins, directions) == hit).all()
    # Limits, of one ray or of all; one origin for all; float64 and lists are converted.
    short = tracer.occluded(origins, directions, t_max=np.where(hit, hits["t"] * 0.999, 1))
    assert not short[np.isfinite(expected)].any()
    middle = tracer.closest([[0.5, 0.5, 0.5]], directions.astype(np.float64), t_min=0.25, t_max=10)
    assert np.isfinite(middle["t"]).all()
    assert not tracer.occluded([[0.5, 0.5, 0.5]], directions, t_max=0.49).any()


def test_wrong_arrays_are_refused():
    corners, triangles = cube()
    for wrong, message in (
        (lambda: curitiba.Tracer(corners[:, :2], triangles), r"valid: \(n, 3\)"),
        (lambda: curitiba.Tracer(corners, triangles + 1), "names 8; there are 8 positions"),
        (lambda: curitiba.Tracer(corners, triangles - 1), "names -1"),
        (lambda: curitiba.Tracer(corners, triangles).closest(corners, corners[:3]), "8 origins for 3 directions"),
        (lambda: curitiba.Tracer(corners, triangles).occluded(corners, corners, t_max=[1, 2]), r"\(8,\)"),
        (lambda: curitiba.visibility(corners, triangles, [[0, 12]]), "names 12; there are 12 triangles"),
        (lambda: curitiba.visibility(corners, triangles, [[0, 1]], samples=9), "multiple of 8"),
    ):
        with pytest.raises(ValueError, match=message):
            wrong()
    assert curitiba.Tracer(np.zeros((0, 3)), np.zeros((0, 3), int)).closest([[0, 0, 0]], [[0, 0, 1]])["triangle"][0] == -1


def test_triangles_that_face_each_other_are_seen_and_a_wall_hides():
    # Two parallel triangles that look at each other, and a wall between them.
    near = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    far = [[0, 0, 2], [0, 1, 2], [1, 0, 2]]
    wall = [[-9, -9, 1], [9, -9, 1], [0, 19, 1]]
    triangles = np.arange(9).reshape(3, 3)
    pairs = [[0, 1], [1, 0]]
    open_ = curitiba.visibility(np.array(near + far, np.float32), triangles[:2], pairs, form_factors=True)
    assert open_["visibility"].tolist() == [1, 1] and open_["class"] == ["open", "open"] and open_["error"].tolist() == [0, 0]
    # An independent reference: the double integral over both triangles by midpoints.
    n = 24
    s, t = np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n)
    u, v = 1 - np.sqrt(s.ravel()), t.ravel() * np.sqrt(s.ravel())
    d2 = (u[:, None] - u[None]) ** 2 + (v[:, None] - v[None]) ** 2 + 4
    assert open_["form_factors"][0, 0] == pytest.approx(0.5 * (4 / d2 / (np.pi * d2)).mean(), rel=2e-3)
    hidden = curitiba.visibility(np.array(near + far + wall, np.float32), triangles, pairs, samples=256)
    assert hidden["visibility"].tolist() == [0, 0]


def test_other_threads_go_on_while_it_renders():
    renderer = opened("SceneSSAO", size=(256, 256), parameters={"pass2.samples": 256, "pass2.radius": 2})
    counted, done = [0], threading.Event()

    def count():
        while not done.is_set():
            counted[0] += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    before = counted[0]
    renderer.render()
    meanwhile = counted[0] - before
    done.set()
    thread.join()
    assert meanwhile > 20, "the interpreter was held"


QUIET = """
import curitiba, sys
renderer = curitiba.open(sys.argv[1], size=(64, 64), backend="cpu", raster="cpu")
renderer.accumulate("1500ms")
curitiba.set_progress(False)
renderer.accumulate("1500ms")
"""


def test_nothing_is_drawn_where_no_terminal_is():
    done = subprocess.run([sys.executable, "-c", QUIET, str(PROJECTS / "SceneSSAO.xml")], stderr=subprocess.PIPE, check=True)
    assert done.stderr == b""


INTERRUPTED = """
import curitiba, numpy as np, sys
renderer = curitiba.open(sys.argv[1], size=(1024, 1024), backend="cpu", raster="cpu", parameters={"pass2.samples": 4096, "pass2.radius": 2})
try:
    renderer.render()
    print("rendered", flush=True)
except KeyboardInterrupt:
    renderer.set_parameter("pass2", "samples", 1)
    print("interrupted", renderer.render().shape, flush=True)
"""


@pytest.mark.skipif(os.name != "posix", reason="signals and terminals are as on Unix")
def test_a_long_frame_shows_how_far_it_is_and_ctrl_c_ends_it_and_the_renderer_goes_on():
    terminal, end = os.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED, str(PROJECTS / "SceneSSAO.xml")],
        stdout=subprocess.PIPE,
        stderr=end,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    os.close(end)
    written = b""
    while written.count(b"%") < 4:
        written += os.read(terminal, 4096)
    process.send_signal(signal.SIGINT)
    # Without the interrupt it would take minutes.
    assert process.communicate(timeout=60)[0] == "interrupted (1024, 1024, 4)\n"
    written += os.read(terminal, 1 << 16)
    os.close(terminal)
    lines = written.decode().split("\r")
    assert lines[0] == "" and lines[-1] == "" and lines[-2].strip() == "", "the line is taken away in the end"
    # The picture that follows has a line of its own if it takes longer than a second on a busy machine.
    lines = lines[1 : next(index for index, line in enumerate(lines) if line and not line.strip())]
    shares = [int(line.split("%")[0].split()[-1]) for line in lines]
    assert all(line.startswith("rays pass2 [") for line in lines), lines
    assert shares == sorted(shares) and 0 <= shares[-1] < 100, shares


def test_the_notebook_runs_and_makes_its_figure(tmp_path, monkeypatch):
    notebook = json.loads((ROOT / "examples" / "raster_or_rays.ipynb").read_text())
    assert notebook["nbformat"] == 4
    monkeypatch.setenv("CURITIBA_PROJECTS", str(PROJECTS))
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setenv("CURITIBA_SIZE", "96")
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "__main__"}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), "raster_or_rays.ipynb", "exec"), names)
    assert (tmp_path / "raster_or_rays.png").stat().st_size > 10_000
    rows = names["rows"]
    occlusion = [row for row in rows if row["program"] == "ssao"]
    # More samples come nearer to the reference.
    assert len(occlusion) >= 4 and occlusion[-1]["rmse"] < 0.5 * occlusion[0]["rmse"]
    assert any(row["kind"] == "raster" for row in rows)
