#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Maps a world while the robot follows its tour, or Bug 2 where the world has no tour; compares the map with the world
# and draws both. DEMO_ARGS are launch arguments of mapping.launch, such as "seed:=3" or "drive:=bug2".
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

enter_run_environment
cd "$WORKSPACE"
read -r -a demo_args <<< "${DEMO_ARGS:-}"
world=world02.world
for word in "${demo_args[@]}"; do
    if [[ $word == world:=* ]]; then
        world=${word#world:=}
    fi
done
name=$(basename "${world%.world}")
drive=bug2
if [ -r "$WORKSPACE/src/m2wr_sim/tours/$name.yaml" ]; then
    drive=tour
fi
folder=$WORKSPACE/demo_output
mkdir -p "$folder"
rm -f "$folder"/map.pgm "$folder"/map.yaml "$folder"/map.png
port=$("$PYTHON" -c "from m2wr_tools.runs.experiment import free_port; print(free_port())")
rosrun m2wr_sim experiment --port "$port" --timeout 900 m2wr_sim mapping.launch gui:=false real_time_factor:=5 \
    exit_on_goal:=true "drive:=$drive" "map:=$folder/map" "${demo_args[@]}"
rosrun m2wr_sim compare_map "$folder/map.yaml" "$world" --picture "$folder/map.png"
say "map $folder/map.pgm, over its world $folder/map.png"
