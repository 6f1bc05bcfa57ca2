#!/usr/bin/env bash
# Lints and tests the window: on a software Vulkan driver (mesa-vulkan-drivers), and once in a real window where Xvfb is (xvfb, xauth).
# Not a step of .ci/run: the crates that both use are compiled once more here, with the features that a window asks of them.
set -euo pipefail
cd "$(dirname "$0")"
cargo fmt --check
cargo clippy --all-targets --target-dir ../target --locked -- -D warnings
CURITIBA_REQUIRE_GPU_TESTS=${CURITIBA_REQUIRE_GPU_TESTS-1} CURITIBA_REQUIRE_XVFB_TESTS=${CURITIBA_REQUIRE_XVFB_TESTS-1} \
    cargo test --target-dir ../target --locked --no-fail-fast
