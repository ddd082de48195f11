#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Sends invalid input to readers, services, topics and sockets; exit 0 only without findings. Findings: logs/fuzz/.
#   MINUTES    duration (default 2)
#   FUZZ_ARGS  options, such as "--target urdf --seed 3" or "--cases 200000" (fuzz.py -h)
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

enter_run_environment
cd "$WORKSPACE"
read -r -a fuzz_args <<< "${FUZZ_ARGS:-}"
if [[ " ${fuzz_args[*]} " != *" --cases "* ]]; then
    fuzz_args=(--minutes "${MINUTES:-2}" "${fuzz_args[@]}")
fi
exec "$PYTHON" test/fuzz/fuzz.py "${fuzz_args[@]}"
