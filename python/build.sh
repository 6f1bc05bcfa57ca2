#!/usr/bin/env bash
# Builds the wheel into python/dist: `python/build.sh`, or `python/build.sh --features cuda`. Needs Rust, Python 3.10 or later, and the
# network or a mirror for maturin. One wheel serves every later Python. PYTHON names another interpreter; PROFILE=dev is compiled faster and
# runs slower, for tests.
set -euo pipefail
cd "$(dirname "$0")"
tools=${VENV:-../target/python-tools}
[ -x "$tools/bin/maturin" ] || {
    "${PYTHON:-python3}" -m venv "$tools"
    "$tools/bin/pip" install --quiet 'maturin>=1.9,<2'
}
# In the workspace's target folder: what both compile alike is compiled once.
CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/../target} "$tools/bin/maturin" build \
    --locked --profile "${PROFILE:-release}" --out dist --interpreter "${PYTHON:-python3}" "$@"
