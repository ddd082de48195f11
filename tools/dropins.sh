#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Lets each stand-in package below dropin/ be built only where no real package of its name is found, installed or in src/: writes or removes
# its CATKIN_IGNORE, which catkin, rospack and roslaunch respect. Prints only changes.
# M2WR_KEEP_DROPINS="gazebo_ros gazebo_plugins" keeps stand-ins although the real ones exist.
set -euo pipefail

WORKSPACE=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
NOETIC=${M2WR_NOETIC_PREFIX:-/opt/ros/noetic}
SYSTEM=${M2WR_SYSTEM_PREFIX:-/usr}

# Prints the package.xml of a real package NAME below PREFIX (an install or a devel space), if there is one.
real_package() {
    local name=$1 prefix=$2 xml config source
    xml=$prefix/share/$name/package.xml
    config=$prefix/share/$name/cmake/${name}Config.cmake
    if [ ! -r "$xml" ] && [ -r "$config" ]; then
        source=$(sed -n "s/^ *set(${name}_SOURCE_PREFIX \(.*\))$/\1/p" "$config")
        xml=$source/package.xml
    fi
    # our own package, installed or built elsewhere, is not a real one
    if [ -r "$xml" ] && ! grep -q 'm2wr\.example' "$xml"; then
        printf '%s\n' "$xml"
    fi
}

# Prints the package.xml of each real package in the sources of this workspace that catkin does not ignore.
real_sources() {
    local xml folder
    if [ ! -d "$WORKSPACE/src" ]; then
        return
    fi
    find -L "$WORKSPACE/src" -maxdepth 6 -name package.xml 2>/dev/null | sort | while IFS= read -r xml; do
        folder=${xml%/*}
        while [ "$folder" != "$WORKSPACE/src" ] && [ ! -e "$folder/CATKIN_IGNORE" ]; do
            folder=${folder%/*}
        done
        if [ "$folder" = "$WORKSPACE/src" ] && [ ! -e "$folder/CATKIN_IGNORE" ] && ! grep -q 'm2wr\.example' "$xml"; then
            printf '%s\n' "$xml"
        fi
    done
}

declare -A sources=()
while IFS= read -r xml; do
    sources[$(sed -n 's:.*<name>[[:space:]]*\([^<[:space:]]*\)[[:space:]]*</name>.*:\1:p' "$xml" | head -n 1)_]=$xml
done < <(real_sources)

IFS=: read -r -a prefixes <<< "${CMAKE_PREFIX_PATH:-}"
for folder in "$WORKSPACE"/dropin/*/; do
    folder=${folder%/}
    name=${folder##*/}
    found=
    if [[ " ${M2WR_KEEP_DROPINS:-} " != *" $name "* ]]; then
        found=${sources[${name}_]:-}
        for prefix in "${prefixes[@]}" "$NOETIC" "$SYSTEM"; do
            found=${found:-$(real_package "$name" "$prefix")}
        done
    fi
    if [ -n "$found" ] && [ ! -e "$folder/CATKIN_IGNORE" ]; then
        printf '%s is there\n' "$found" > "$folder/CATKIN_IGNORE"
        printf '== dropin/%s is left out: found %s\n' "$name" "$found"
    elif [ -z "$found" ] && [ -e "$folder/CATKIN_IGNORE" ]; then
        rm "$folder/CATKIN_IGNORE"
        printf '== dropin/%s is built: no other package of that name is found\n' "$name"
    fi
done
