#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Sets up a machine: system packages, workspace venv, build. A second run changes nothing.
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
# shellcheck source=tools/venv.sh
source "$WORKSPACE/tools/venv.sh"

# Runs a command as root: directly, or through sudo, or ends with a message about what is missing.
as_root() {
    if [ "$(id -u)" -eq 0 ]; then
        "$@"
    elif command -v sudo >/dev/null; then
        sudo -- "$@"
    else
        die "system packages are missing and this is neither root nor is there sudo. Run as root: $*"
    fi
}

CLIENT_PACKAGES=$WORKSPACE/src/m2wr_sim/config/client_packages.txt

# Reads names of packages, prints those that are not installed.
apt_missing() {
    local package
    while read -r package; do
        if [ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null)" != installed ]; then
            printf '%s\n' "$package"
        fi
    done
}

# Packages for programs written for Gazebo: column 1 of the list has Debian's names, column 2 those of ROS packages.
client_packages() {
    list_entries "$CLIENT_PACKAGES" | awk -v column="$1" '
        column == 2 && $2 != "-" { gsub("_", "-", $2); print "ros-noetic-" $2; next }
        { print $1 }' | LC_ALL=C sort -u
}

install_apt_packages() {
    local missing
    mapfile -t missing < <({ list_entries "$WORKSPACE/tools/apt-packages.txt"; client_packages 1; } | apt_missing)
    if [ ${#missing[@]} -eq 0 ]; then
        say "system packages: all present"
        return
    fi
    say "system packages: installing ${#missing[@]}: ${missing[*]}"
    local wait_for_lock=(-o DPkg::Lock::Timeout=600 -o APT::Acquire::Retries=3)
    as_root env DEBIAN_FRONTEND=noninteractive apt-get "${wait_for_lock[@]}" -q update
    as_root env DEBIAN_FRONTEND=noninteractive apt-get "${wait_for_lock[@]}" -q install -y --no-install-recommends \
        -o Dpkg::Use-Pty=0 "${missing[@]}" < /dev/null
}

install_noetic_packages() {
    local stamp=$CATKIN_BUILD/.m2wr_rosdep_hash now
    now=$(cd "$WORKSPACE" && cat src/*/package.xml test/package.xml tools/setup.sh "$CLIENT_PACKAGES" | sha256sum)
    if [ "$(cat "$stamp" 2>/dev/null)" = "$now" ]; then
        say "system packages: package.xml files unchanged since the last rosdep run"
        return
    fi
    command -v rosdep >/dev/null || as_root apt-get -q install -y python3-rosdep
    as_root env DEBIAN_FRONTEND=noninteractive apt-get -q install -y python3-venv python3-dev python3-catkin-tools \
        python3-catkin-lint python3-flake8 python3-pytest python3-pytest-timeout python3-pytest-xdist build-essential \
        libode-dev shellcheck
    # shellcheck disable=SC2046
    as_root env DEBIAN_FRONTEND=noninteractive apt-get -q install -y $(client_packages 2)
    [ -d /etc/ros/rosdep/sources.list.d ] || as_root rosdep init
    rosdep update --rosdistro noetic
    # shellcheck disable=SC2046
    rosdep install --from-paths "$WORKSPACE/src" "$WORKSPACE/test" --ignore-src --rosdistro noetic -y \
        --skip-keys "$(list_entries "$WORKSPACE/tools/rosdep-skip-keys.txt" | tr '\n' ' ')"
    mkdir -p "$CATKIN_BUILD"
    printf '%s' "$now" > "$stamp"
}

install_venv() {
    local requirements=$WORKSPACE/tools/$1 modules=$2
    make_venv "$VENV" "$requirements" --system-site-packages
    "$VENV/bin/python" -c "import $modules" ||
        die "the packages of $requirements are installed in $VENV but cannot be imported (see above);" \
            "remove $VENV and run make setup again."
}

build_if_changed() {
    "$WORKSPACE/tools/dropins.sh"
    if [ -r "$WORKSPACE/devel/setup.bash" ] && [ "$(cat "$BUILD_STAMP" 2>/dev/null)" = "$(source_hash)" ]; then
        say "build: sources unchanged since the last build"
    else
        "$WORKSPACE/tools/build.sh"
    fi
}

detect_platform
cd "$WORKSPACE"
if [ "$PLATFORM" = debian12 ]; then
    install_apt_packages
    install_venv requirements.txt "xacro, urdf_parser_py.urdf, rosbags.rosbag1, collada, trimesh, viser, cbor2, mcap, numpy, lxml, yaml"
else
    install_noetic_packages
    install_venv requirements-noetic.txt "ode, rosbags.rosbag1, collada, trimesh, cbor2, mcap, msgspec, websockets, numpy, yaml"
fi
build_if_changed
say "set-up complete; in a shell: source $WORKSPACE/devel/setup.bash"
