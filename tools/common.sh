# SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=bash
# shellcheck disable=SC2034  # the variables are read by the scripts that source this file
# Sourced by every script in tools/: where the workspace is, which platform this is, and the environment of its tools.

set -euo pipefail

WORKSPACE=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
PYTHON=/usr/bin/python3
VENV=$WORKSPACE/.venv
CATKIN_BUILD=$WORKSPACE/catkin_build
RESULTS=$WORKSPACE/test_results
BUILD_STAMP=$CATKIN_BUILD/.m2wr_source_hash

# Ignore the settings of the caller's shell: another overlay, another interpreter's packages.
unset CMAKE_PREFIX_PATH ROS_PACKAGE_PATH PYTHONPATH PYTHONHOME VIRTUAL_ENV _CATKIN_SETUP_DIR
# Debian's base images set no locale; the tools print UTF-8.
export LC_ALL=C.UTF-8
export HOME=${HOME:-$(getent passwd "$(id -u)" | cut -d: -f6)}

say() {
    printf '== %s\n' "$*"
}

die() {
    printf 'm2wr: %s\n' "$*" >&2
    exit 1
}

# Sets PLATFORM to debian12 or noetic, or ends with the platform found and the supported ones.
# M2WR_OS_RELEASE and M2WR_NOETIC_PREFIX replace the real files in tests.
detect_platform() {
    local os_release=${M2WR_OS_RELEASE:-/etc/os-release} noetic=${M2WR_NOETIC_PREFIX:-/opt/ros/noetic} id version found
    local supported="Supported: Debian 12 (bookworm), and Ubuntu 20.04 with ROS Noetic in /opt/ros/noetic."
    [ -r "$os_release" ] || die "cannot read $os_release, so this platform is unknown. $supported"
    id=$(sed -n 's/^ID=//p' "$os_release" | tr -d "\"'")
    version=$(sed -n 's/^VERSION_ID=//p' "$os_release" | tr -d "\"'")
    found="${id:-no ID} ${version:-no VERSION_ID}"
    case "$id $version" in
        "debian 12")
            PLATFORM=debian12 ;;
        "ubuntu 20.04")
            [ -r "$noetic/setup.bash" ] || die "found Ubuntu 20.04, but no $noetic/setup.bash. Install ROS Noetic" \
                "(package ros-noetic-ros-base, see wiki.ros.org/noetic/Installation/Ubuntu), then run make setup again."
            PLATFORM=noetic ;;
        *)
            die "the set-up does not support this platform: $os_release has \"$found\". $supported" ;;
    esac
    NOETIC=$noetic
}

# Sources a ROS set-up file, which reads variables that are not set.
source_ros() {
    [ -r "$1" ] || die "no $1; run make setup first."
    set +u
    # shellcheck disable=SC1090
    source "$1"
    set -u
}

# Environment in which catkin runs: Debian's ROS is in /usr and needs nothing, Noetic's is sourced.
enter_build_environment() {
    detect_platform
    if [ "$PLATFORM" = noetic ]; then
        source_ros "$NOETIC/setup.bash"
    fi
}

# By default ROS uses the loopback address, so that it works on a machine whose own host name does not resolve (a
# container, a chroot). Only the name localhost must resolve.
use_loopback() {
    getent hosts localhost >/dev/null ||
        die "the name localhost does not resolve, which every ROS program needs; add '127.0.0.1 localhost' to" \
            "/etc/hosts."
    if [ -z "${ROS_HOSTNAME:-}${ROS_IP:-}" ]; then
        export ROS_HOSTNAME=localhost
    fi
}

# Environment in which nodes run.
enter_run_environment() {
    source_ros "$WORKSPACE/devel/setup.bash"
    use_loopback
}

# Entries of a list file, without comments and blank lines.
list_entries() {
    sed -e 's/#.*//' -e 's/[[:space:]]*$//' -e '/^$/d' "$1"
}

# The pinned versions in a file of requirements, `name==version` each, without their hashes.
pins() {
    list_entries "$1" | sed -n 's/^\([A-Za-z0-9._-]*==[^ ]*\).*/\1/p'
}

# One hash over all input of a build, and over its location (both spaces contain absolute paths).
source_hash() {
    (
        cd "$WORKSPACE"
        pwd
        find CMakeLists.txt .catkin_tools/profiles/default/config.yaml src test dropin tools/common.sh tools/build.sh tools/dropins.sh \
            \( -name __pycache__ -o -name .pytest_cache \) -prune -o \
            -type f ! -name '*.pyc' ! -name '*~' ! -name '*.swp' -print0 |
            LC_ALL=C sort -z | xargs -0 -r sha256sum
    ) | sha256sum | cut -d' ' -f1
}
