#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Runs the tests of every package and prints one summary. The set-up has already built the workspace.
#   TEST_PACKAGES  names of packages, separated by blanks (default: all)
#   TEST_JOBS      tests of a package that run concurrently (default 2, on one processor 1; a test mostly waits for its
#                  nodes)
#   PYTEST_ADDOPTS more options for pytest; they override those given here, for example -n 4
#   TEST_TIMEOUT   seconds after which the run is ended; tests without a result count as failed
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

enter_build_environment
cd "$WORKSPACE"
read -r -a packages <<< "${TEST_PACKAGES:-}"
processors=$(nproc)
jobs=${TEST_JOBS:-$((processors < 2 ? 1 : 2))}
limit=${TEST_TIMEOUT:-3900}

[ -r "$BUILD_STAMP" ] || die "the workspace is not built; run make setup first."
find "$CATKIN_BUILD" -mindepth 2 -maxdepth 2 -type d -name 'test_results*' -print0 | xargs -0 -r rm -rf
started=$(date +%s)

use_loopback
# logs of the nodes stay in the workspace; one folder a run
ROS_LOG_DIR=$WORKSPACE/logs/ros/$(date +%Y%m%d-%H%M%S)
export ROS_LOG_DIR
mkdir -p "$ROS_LOG_DIR"

# With stored bytecode, as on a user's machine: without it each of some hundred nodes compiles its sources again.
unset PYTHONDONTWRITEBYTECODE

# The Python tests of a package, one process a job, if pytest-xdist is installed. A file stays in one process, so that its
# tests share what is made once. m2wr_test sets -n 0: there make runs several tests at once.
pytest_options="--color=no -q"
if [ "$jobs" -gt 1 ] && "$PYTHON" -c "import xdist" 2> /dev/null; then
    pytest_options+=" -n $jobs --dist loadfile"
fi
export PYTEST_ADDOPTS="$pytest_options ${PYTEST_ADDOPTS:-}"

# catkin removes -j from --make-args and passes nothing on for tests, so make gets it here; the output of each test is
# kept together.
export MAKEFLAGS="-j$jobs --output-sync=target"

say "tests: ${packages[*]:-all packages}, $jobs at a time, at most $limit s"
status=0
# A job of its own: `timeout` ends the whole group, and an interrupt at the keyboard is passed on to it.
set -m
timeout --kill-after=60 "$limit" catkin test --workspace "$WORKSPACE" --profile default --no-status --no-notify \
    --continue-on-failure -p 1 "${packages[@]}" < /dev/null &
runner=$!
set +m
trap 'kill -INT "$runner" 2>/dev/null; wait "$runner" || true; die "tests: interrupted"' INT TERM
wait "$runner" || status=$?
trap - INT TERM
say "tests: ended after $(($(date +%s) - started)) s"

# A ROS test that failed runs once more, alone; the summary lists it as FLAKY if it passes then.
if [ "$status" -eq 1 ]; then
    # ctest starts the tests as they are; catkin had given them the environment of the workspace
    (
        enter_run_environment
        timeout --kill-after=60 "$limit" "$PYTHON" "$WORKSPACE/tools/test_again.py" "$WORKSPACE" --since "$started" \
            "${packages[@]}" < /dev/null
    ) || say "tests: the second run ended with exit code $?"
fi

problems=()
case $status in
    0 | 1) ;;  # 1: a test failed, which the summary reports in full
    124 | 137) problems+=(--problem "the run was ended after TEST_TIMEOUT=$limit s") ;;
    *) problems+=(--problem "catkin test ended with exit code $status") ;;
esac
"$PYTHON" "$WORKSPACE/tools/test_summary.py" "$WORKSPACE" --since "$started" "${problems[@]}" "${packages[@]}"
