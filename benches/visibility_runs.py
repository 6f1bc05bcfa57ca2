#!/usr/bin/env python3
"""Times of `curitiba visibility` on some cases, as a table that documents quote.

    benches/visibility_runs.py OUT.json [--program PROGRAM] [--rounds N] [NAME=ARGUMENTS … | NAME=SUMMARY.json …]
    benches/visibility_runs.py OUT.json --embree BENCH.json

A case is a name and the arguments of the command, or what a run with `--json` printed elsewhere. Of several rounds the fastest counts. With
`--embree` the rows of the bench beside Embree (`--bench embree -- --pairs --out BENCH.json`) become a table.
"""

import argparse
import json
import os
import platform
import resource
import shlex
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def environment(threads):
    """Where and of what this was measured, as `curitiba bench` writes it."""
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True).stdout.strip()
    changed = subprocess.run(["git", "status", "--porcelain", "--untracked-files=no"], cwd=ROOT, capture_output=True, text=True)
    names = [line.split(":", 1)[1].strip() for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("model name")]
    return {
        "commit": commit + ("-dirty" if changed.stdout.strip() else ""),
        "cpu": names[0] if names else platform.processor(),
        "threads": threads,
        "platform": f"{sys.platform} {platform.machine()}",
        "load_average": round(os.getloadavg()[0], 2),
        "python": platform.python_version(),
        "gpu": [],
    }


def run(program, arguments, rounds):
    """The summary of the fastest round, with the processor's time."""
    best = None
    for _ in range(rounds):
        with tempfile.TemporaryDirectory() as folder:
            command = [program, "visibility", *shlex.split(arguments), "--json", "-o", f"{folder}/rows.npy"]
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            told = subprocess.run(command, capture_output=True, text=True, check=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
        summary = json.loads(told.stdout)
        summary["processor_seconds"] = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        if best is None or summary["seconds"] < best["seconds"]:
            best = summary
    return best


def row(name, summary):
    """A line of the table."""
    pairs, seconds = summary["pairs"] - summary["resumed"], summary["seconds"]
    exact = 1.0 - summary["classes"]["sampled"] / max(summary["pairs"], 1)
    peak = summary["peak_memory"]
    processor = summary.get("processor_seconds")
    return [
        name,
        summary["backend"],
        summary["threads"],
        pairs,
        100.0 * exact,
        1e-3 * pairs / seconds,
        1e-6 * summary["samples"] / seconds,
        seconds,
        processor,
        None if peak is None else round(peak / (1 << 20)),
    ]


COLUMNS = [
    "pairs of",
    "engine",
    "threads",
    "pairs",
    "exact, %",
    "1000 pairs/s",
    "million segments/s",
    "s",
    "s of all processors",
    "peak, MiB",
]


EMBREE = [
    "scene",
    "threads",
    "pairs",
    "exact, %",
    "1000 pairs/s",
    "Embree's loop",
    "its watertight tree",
    "ratio",
    "ratio to the watertight",
    "mean",
    "of the loop",
]


def embree_rows(bench):
    """The rows of the bench beside Embree."""
    rows = []
    for scene in bench["scenes"]:
        for pairs in scene.get("pairs", []):
            rate = lambda side: 1e-3 * pairs["pairs"] / statistics.median(pairs[side]["wall_s"])
            rows.append([
                f"{scene['scene']}, {scene['triangles']} triangles",
                pairs["threads"],
                pairs["pairs"],
                100.0 * pairs["exact"] / pairs["pairs"],
                *(rate(side) for side in ("ours", "embree", "embree_robust")),
                pairs["ratio_wall"],
                rate("ours") / rate("embree_robust"),
                *(round(mean, 4) for mean in pairs["means"]),
            ])
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("output")
    parser.add_argument("cases", nargs="*")
    parser.add_argument("--embree", help="a file of the bench beside Embree")
    parser.add_argument("--program", default="target/release/curitiba")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--cpu", help="of the machine where the summaries are from")
    parser.add_argument("--gpu", action="append", default=[])
    arguments = parser.parse_args()
    if arguments.embree:
        bench = json.loads(Path(arguments.embree).read_text())
        result = {
            "environment": bench["environment"],
            "unix_s": bench["started_unix_s"],
            "command": bench["command"],
            "bench": bench,
            "tables": {"embree": {"columns": EMBREE, "rows": embree_rows(bench)}},
        }
        Path(arguments.output).write_text(json.dumps(result, indent=1) + "\n")
        return
    threads, rows, summaries = os.cpu_count(), [], {}
    for case in arguments.cases:
        name, _, what = case.partition("=")
        summary = json.loads(Path(what).read_text()) if what.endswith(".json") else run(arguments.program, what, arguments.rounds)
        rows.append(row(name, summary))
        summaries[f"{name}, {summary['backend']}"] = summary
        threads = summary["threads"]
        print(rows[-1], flush=True)
    where = environment(threads)
    where.update({"cpu": arguments.cpu, "load_average": None} if arguments.cpu else {}, gpu=arguments.gpu)
    result = {
        "environment": where,
        "unix_s": int(time.time()),
        "command": "benches/visibility_runs.py",
        "summaries": summaries,
        "tables": {"runs": {"columns": COLUMNS, "rows": rows}},
    }
    Path(arguments.output).write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
