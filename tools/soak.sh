#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Runs simulation and mapper for simulated hours; exit 0 only if memory, descriptors and threads do not grow. Figure: demo_output/soak.png.
#   HOURS      simulated (default 24); all counts are proportional
#   SOAK_ARGS  options, such as "--factor 20" (soak.py -h)
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

enter_run_environment
cd "$WORKSPACE"
read -r -a soak_args <<< "${SOAK_ARGS:-}"
exec "$PYTHON" test/soak/soak.py --hours "${HOURS:-24}" "${soak_args[@]}"
