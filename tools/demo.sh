#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Runs the demonstration in the built workspace; exit 0 only if the robot reached its goal. DEMO_ARGS are passed on.
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

enter_run_environment
cd "$WORKSPACE"
read -r -a demo_args <<< "${DEMO_ARGS:-}"
exec rosrun m2wr_sim demo "${demo_args[@]}"
