#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Runs the demonstration in the built workspace; exit 0 only if the robot reached its goal. DEMO_ARGS are passed on.
#   LIVE   1: watch it in a browser; the recorded run stays on the page until Ctrl-C
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

enter_run_environment
cd "$WORKSPACE"
read -r -a demo_args <<< "${DEMO_ARGS:-}"
case ${LIVE:-} in
    "" | 0 | false | no) ;;
    *) demo_args+=(--live) ;;
esac
exec rosrun m2wr_sim demo "${demo_args[@]}"
