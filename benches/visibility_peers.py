#!/usr/bin/env python3
"""Visibility and form factors beside pyviewfactor 1.1.0 and raystrack 2.0.0, in one run.

    python3 -m venv peers && peers/bin/pip install pyviewfactor==1.1.0 raystrack==2.0.0
    peers/bin/python benches/visibility_peers.py target/release/curitiba docs/measurements/visibility_peers.json

Every case is timed after a first call that compiles or loads, and all programs get the same number of threads. pyviewfactor is exact for
pairs with nothing in between: it is the oracle of those. raystrack samples areas: both of its estimates and ours lie about the exact value
by their standard errors.
"""

import argparse
import csv
import json
import math
import os
import random
import subprocess
import tempfile
import time
from pathlib import Path

import numpy

from visibility_runs import environment


def write_obj(path, triangles):
    """A file of triangles that share no corners: ids are places in the list."""
    with open(path, "w") as file:
        for triangle in triangles:
            for corner in triangle:
                file.write("v {:.9g} {:.9g} {:.9g}\n".format(*corner))
        for index in range(len(triangles)):
            file.write(f"f {3 * index + 1} {3 * index + 2} {3 * index + 3}\n")


class Curitiba:
    """The program, on files in a folder."""

    def __init__(self, program, folder, threads):
        self.program, self.folder, self.threads = Path(program).resolve(), Path(folder), threads

    def rows(self, triangles, pairs, *options):
        """The rows as dictionaries, and what the program says of the run."""
        scene, output = self.folder / "scene.obj", self.folder / "rows.csv"
        write_obj(scene, triangles)
        if not isinstance(pairs, str):
            listed = self.folder / "pairs.csv"
            listed.write_text("".join(f"{a},{b}\n" for a, b in pairs))
            pairs = str(listed)
        command = [self.program, "visibility", scene, "--pairs", pairs, "--quantity", "form-factor", "--backend", "cpu"]
        command += ["--threads", str(self.threads), "--json", "-o", output, *options]
        told = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=True)
        with open(output) as file:
            file.readline()
            return list(csv.DictReader(file)), json.loads(told.stdout)


def facing_pairs(count, seed):
    """Random triangles of which each two are alone in their place and face each other."""
    numbers = random.Random(seed)
    triangles = []
    while len(triangles) < 2 * count:
        cell = len(triangles) // 2
        place = 20.0 * numpy.array([cell % 10, cell // 10 % 10, cell // 100])
        point = lambda: numpy.array([numbers.uniform(-1.0, 1.0) for _ in range(3)])
        pair = numpy.array([[place + point() + offset for _ in range(3)] for offset in ([0, 0, 0], [0, 0, numbers.uniform(0.5, 6.0)])])
        # Rounded to 32 bits, as a file with the shortest decimal numbers of that precision has it.
        pair = pair.astype(numpy.float32).astype(numpy.float64)
        normals = [numpy.cross(t[1] - t[0], t[2] - t[0]) for t in pair]
        if normals[0][2] < 0:
            pair[0] = pair[0][::-1]
        if normals[1][2] > 0:
            pair[1] = pair[1][::-1]
        a, b = pair
        n, m = (numpy.cross(t[1] - t[0], t[2] - t[0]) for t in (a, b))
        if min((b - a[0]) @ n) > 1e-2 and min((a - b[0]) @ m) > 1e-2:
            triangles += [a, b]
    return triangles


def against_pyviewfactor(curitiba, count):
    """Pairs with nothing in between: the largest difference of the form factors."""
    import pyviewfactor
    import pyvista

    triangles = facing_pairs(count, 1)
    pairs = [(2 * index, 2 * index + 1) for index in range(count)]
    rows, _ = curitiba.rows(triangles, pairs)
    worst, classes = 0.0, set()
    for row, (a, b) in zip(rows, pairs):
        cells = [pyvista.PolyData(triangles[index], faces=[3, 0, 1, 2]) for index in (a, b)]
        # pyviewfactor's first cell is the receiver; it rounds coordinates to eight decimals.
        exact = pyviewfactor.compute_viewfactor(cells[1], cells[0])
        worst = max(worst, abs(exact - float(row["f_ab"])))
        classes.add(row["class"])
    return {"case": "unblocked pairs", "pairs": count, "classes": sorted(classes), "largest_difference": worst}


def sphere():
    """448 triangles that look inward."""
    import pyvista

    mesh = pyvista.Sphere(radius=1.0, theta_resolution=16, phi_resolution=16)
    points = mesh.points.astype(numpy.float32).astype(numpy.float64)
    triangles = []
    for index in mesh.faces.reshape(-1, 4)[:, 1:]:
        a, b, c = points[index]
        outward = numpy.cross(b - a, c - a) @ (a + b + c) > 0
        triangles.append(numpy.array([a, c, b] if outward else [a, b, c]))
    assert len(triangles) == 448
    return triangles


def matrix(curitiba, rounds):
    """The full matrix of a closed sphere: time and sums of rows, which are 1."""
    import pyviewfactor
    import pyvista

    triangles = sphere()
    corners = numpy.concatenate(triangles)
    faces = numpy.array([[3, 3 * i, 3 * i + 1, 3 * i + 2] for i in range(len(triangles))])
    mesh = pyvista.PolyData(corners, faces=faces.ravel())
    times = []
    for _ in range(rounds + 1):
        start = time.perf_counter()
        theirs = pyviewfactor.compute_viewfactor_matrix(mesh)
        times.append(time.perf_counter() - start)
    ours = []
    for _ in range(rounds + 1):
        rows, told = curitiba.rows(triangles, "all")
        ours.append((told["build_seconds"] + told["seconds"], told["seconds"]))
    sums = numpy.zeros(len(triangles))
    for row in rows:
        sums[int(row["a"])] += float(row["f_ab"])
        sums[int(row["b"])] += float(row["f_ba"])
    # A column of pyviewfactor's matrix holds the factors from one face.
    other = theirs.sum(axis=0)
    return {
        "case": "matrix of a sphere",
        "triangles": len(triangles),
        "curitiba": {
            "seconds": min(whole for whole, _ in ours[1:]),
            "pairs_seconds": min(pairs for _, pairs in ours[1:]),
            "row_sums": [sums.min(), sums.max()],
        },
        "pyviewfactor": {"seconds": min(times[1:]), "row_sums": [other.min(), other.max()]},
    }


def squares(height):
    """Two unit squares that face each other, and a half plane in the middle between them, of two triangles."""
    def quad(a, b, c, d):
        return [numpy.array([a, b, c], float), numpy.array([a, c, d], float)]

    low = quad((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))
    high = quad((0, 0, height), (0, 1, height), (1, 1, height), (1, 0, height))
    middle = 0.5 * height
    wall = quad((-9, -9, middle), (0.5, -9, middle), (0.5, 9, middle), (-9, 9, middle))
    return low, high, wall


def half_blocked(curitiba, samples, rounds):
    """Squares of which a half plane hides half: by symmetry half of what they exchange without it."""
    import raystrack

    low, high, wall = squares(1.0)
    # Howell's catalogue, C-11.
    exact = 0.5 * 0.199_824_895_698
    surface = lambda name, triangles: raystrack.Surface(
        name, raystrack.Mesh(numpy.concatenate(triangles), numpy.arange(6).reshape(2, 3))
    )
    scene = raystrack.Scene([surface("low", low), surface("high", high), surface("wall", wall)])
    sampling = raystrack.Sampling(strategy="area_pair", pair_samples=samples // 8, seed=1)
    options = raystrack.SolveOptions(
        sampling=sampling, accuracy=raystrack.Accuracy(max_replicates=8, min_replicates=8, tolerance=0.0)
    )
    theirs = []
    with raystrack.Solver(scene, device="cpu") as solver:
        for _ in range(rounds + 1):
            start = time.perf_counter()
            result = solver.solve(raystrack.Query.pair("low", "high", receiver_sides=("front",)), options)
            theirs.append((time.perf_counter() - start, result.rays_used))
    value, error = float(result.data.estimates[0]), float(result.data.errors[0])
    pairs = [(a, b) for a in (0, 1) for b in (2, 3)]
    each = samples // 4
    ours = []
    for _ in range(rounds + 1):
        # The same pairs are repeated, so that there is enough work to be timed.
        rows, told = curitiba.rows(low + high + wall, pairs * 64, "--samples", str(each))
        ours.append(told["samples"] / told["seconds"])
    rows = rows[:4]
    mean = sum(0.5 * float(row["f_ab"]) for row in rows)
    deviation = math.sqrt(sum((0.5 * float(row["f_ab_error"])) ** 2 for row in rows))
    return {
        "case": "squares, half blocked",
        "exact": exact,
        "curitiba": {"value": mean, "error": deviation, "z": (mean - exact) / deviation, "samples_per_second": max(ours)},
        "raystrack": {
            "value": value,
            "error": error,
            "z": (value - exact) / error,
            "samples_per_second": max(rays / seconds for seconds, rays in theirs[1:]),
        },
    }


def behind_clutter(curitiba, triangles, samples, rounds):
    """Squares with small triangles between them, more than are gathered: sampled segments a second where all are traced."""
    import raystrack

    low, high, _ = squares(1.0)
    numbers = numpy.random.default_rng(3)
    at = numbers.uniform([0.0, 0.0, 0.2], [1.0, 1.0, 0.8], (triangles, 1, 3))
    clutter = list((at + (numbers.uniform(size=(triangles, 3, 3)) - 0.5) * (2.0 / triangles ** 0.5)).astype(numpy.float32).astype(float))
    corners = numpy.concatenate(clutter)
    surface = lambda name, triangles: raystrack.Surface(
        name, raystrack.Mesh(numpy.concatenate(triangles), numpy.arange(3 * len(triangles)).reshape(-1, 3))
    )
    scene = raystrack.Scene([surface("low", low), surface("high", high), surface("clutter", clutter)])
    options = raystrack.SolveOptions(
        sampling=raystrack.Sampling(strategy="area_pair", pair_samples=samples // 8, seed=1),
        accuracy=raystrack.Accuracy(max_replicates=8, min_replicates=8, tolerance=0.0),
    )
    theirs = []
    with raystrack.Solver(scene, device="cpu") as solver:
        for _ in range(rounds + 1):
            start = time.perf_counter()
            result = solver.solve(raystrack.Query.pair("low", "high", receiver_sides=("front",)), options)
            theirs.append((time.perf_counter() - start, result.rays_used))
    value, error = float(result.data.estimates[0]), float(result.data.errors[0])
    pairs = [(a, b) for a in (0, 1) for b in (2, 3)]
    ours = []
    for _ in range(rounds + 1):
        rows, told = curitiba.rows(low + high + clutter, pairs * 64, "--samples", str(samples // 4))
        ours.append(told["samples"] / told["seconds"])
    rows = rows[:4]
    mean = sum(0.5 * float(row["f_ab"]) for row in rows)
    deviation = math.sqrt(sum((0.5 * float(row["f_ab_error"])) ** 2 for row in rows))
    return {
        "case": f"squares behind {len(corners) // 3} triangles",
        "curitiba": {"value": mean, "error": deviation, "samples_per_second": max(ours)},
        "raystrack": {
            "value": value,
            "error": error,
            "samples_per_second": max(rays / seconds for seconds, rays in theirs[1:]),
        },
        "z_between": (mean - value) / math.hypot(deviation, error),
    }


def table(cases):
    """What the documents show."""
    unblocked, sphere_matrix, half, clutter = cases
    rows = [[f"{unblocked['pairs']} pairs alone: largest difference of form factors", "", unblocked["largest_difference"], ""]]
    ours, theirs = sphere_matrix["curitiba"], sphere_matrix["pyviewfactor"]
    rows.append([f"matrix of a sphere of {sphere_matrix['triangles']} triangles, s", ours["seconds"], theirs["seconds"], ""])
    for place, name in enumerate(["least", "greatest"]):
        rows.append([f"{name} sum of its rows", f"{ours['row_sums'][place]:.5f}", f"{theirs['row_sums'][place]:.5f}", ""])
    for case in (half, clutter):
        ours, theirs = case["curitiba"], case["raystrack"]
        rows.append([f"{case['case']}: form factor", f"{ours['value']:.6f}", "", f"{theirs['value']:.6f}"])
        rows.append(["its standard error", ours["error"], "", theirs["error"]])
        rows.append(["million segments/s", 1e-6 * ours["samples_per_second"], "", 1e-6 * theirs["samples_per_second"]])
    return {"columns": ["case", "curitiba", "pyviewfactor", "raystrack"], "rows": rows}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("curitiba", help="the program, built for release")
    parser.add_argument("output", help="the .json file")
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--rounds", type=int, default=3, help="timed repetitions, of which the best counts")
    arguments = parser.parse_args()
    os.environ["NUMBA_NUM_THREADS"] = str(arguments.threads)
    result = {
        "environment": environment(arguments.threads),
        "unix_s": int(time.time()),
        "command": "benches/visibility_peers.py",
        "peers": {"pyviewfactor": "1.1.0", "raystrack": "2.0.0"},
        "cases": [],
    }
    with tempfile.TemporaryDirectory() as folder:
        curitiba = Curitiba(arguments.curitiba, folder, arguments.threads)
        for case in (
            lambda: against_pyviewfactor(curitiba, 1000),
            lambda: matrix(curitiba, arguments.rounds),
            lambda: half_blocked(curitiba, 65536, arguments.rounds),
            lambda: behind_clutter(curitiba, 2000, 65536, arguments.rounds),
        ):
            result["cases"].append(case())
            print(json.dumps(result["cases"][-1]), flush=True)
    result["tables"] = {"peers": table(result["cases"])}
    Path(arguments.output).write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
