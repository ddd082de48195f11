#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Builds every package with catkin-tools (tracked profile `default`); arguments are passed to `catkin build`.
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

enter_build_environment
command -v catkin >/dev/null || die "catkin-tools is not installed; run make setup."
cd "$WORKSPACE"
tools/dropins.sh
hash_before=$(source_hash)
# After a move of the workspace its caches contain the old path, and cmake refuses them.
if [ -r "$CATKIN_BUILD/.m2wr_place" ] && [ "$(cat "$CATKIN_BUILD/.m2wr_place")" != "$WORKSPACE" ]; then
    say "build: the workspace has moved; building from scratch"
    # catkin-tools lists the files of devel/ by absolute path. In a copy these are the files of the original, which a
    # build of the copy would delete.
    rm -rf "$CATKIN_BUILD" "$WORKSPACE/devel" "$WORKSPACE/logs" "$WORKSPACE"/.catkin_tools/profiles/*/packages
fi
# The relay of a script that moved to another package stays in devel/ and would hide the new one.
if [ -d "$WORKSPACE/devel/.private" ]; then
    while IFS= read -r relay; do
        script=$(sed -n "s/^python_script = '\(.*\)'$/\1/p" "$relay")
        if [ -n "$script" ] && [ ! -e "$script" ]; then
            rm -f "$relay"
        fi
    done < <(grep -rlI --include='*' "^python_script = '" "$WORKSPACE"/devel/.private/*/lib)
    find "$WORKSPACE/devel" -xtype l -delete
fi
rm -f "$BUILD_STAMP"
# PYTHONUNBUFFERED: the name of each package is printed when it starts, also into a file.
PYTHONUNBUFFERED=1 M2WR_KERNELS_LATER=1 catkin build --workspace "$WORKSPACE" --profile default --no-status --no-notify --summarize "$@"
printf '%s' "$WORKSPACE" > "$CATKIN_BUILD/.m2wr_place"
if [ -r "$WORKSPACE/devel/lib/m2wr_sim/m2wr_sim_node" ]; then
    say "compiling the kernels into their cache, so that the first launch does not wait (minutes on a slow machine)"
    (enter_run_environment && "$PYTHON" -m m2wr_sim.warm_up)
    if [ -r "$WORKSPACE/devel/lib/m2wr_gmapping/slam_gmapping_replay" ]; then
        # numba checks only a kernel's own file, not those of the kernels and constants that it uses
        for package in m2wr_maps m2wr_gmapping m2wr_navigation; do
            if [ -n "$(find src/m2wr_maps/src "src/$package/src" \( -name '*kernels.py' -o -name '*_layout.py' -o -name 'tuning.py' \
                       -o -name 'track.py' \) -newer "$CATKIN_BUILD/.m2wr_kernels" 2>&1)" ]; then
                find "src/$package/src" \( -name '*.nbi' -o -name '*.nbc' \) -delete
            fi
            (enter_run_environment && "$PYTHON" -m "$package.kernel_warm_up")
        done
        (enter_run_environment && "$PYTHON" -m m2wr_exploration.kernel_warm_up)
        (enter_run_environment && "$PYTHON" -m m2wr_elevation.kernel_warm_up)
        : > "$CATKIN_BUILD/.m2wr_kernels"
    fi
fi
if [ $# -eq 0 ]; then
    printf '%s' "$hash_before" > "$BUILD_STAMP"
fi
