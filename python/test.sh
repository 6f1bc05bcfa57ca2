#!/usr/bin/env bash
# Builds the wheel, installs it into a clean virtual environment and runs the tests there, the notebook included.
# `PROFILE=release python/test.sh` tests what is published.
set -euo pipefail
cd "$(dirname "$0")"
rm -rf dist
PROFILE=${PROFILE:-dev} ./build.sh
clean=$(mktemp -d)
trap 'rm -rf "$clean"' EXIT
"${PYTHON:-python3}" -m venv "$clean/venv"
"$clean/venv/bin/pip" install --quiet dist/curitiba-*.whl pytest pandas polars matplotlib
# From the folder of the tests, so that the wheel is imported and not the sources.
cd tests
"$clean/venv/bin/python" -m pytest -q -p no:cacheprovider --rootdir . "$@" .
