#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Bug 2 with the live view in web browsers, until Ctrl-C: what a container starts with. Arguments are those of bug2.launch.
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

enter_run_environment
cd "$WORKSPACE"
exec roslaunch m2wr_sim bug2.launch gui:=false live:=true "$@"
