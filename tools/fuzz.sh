#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Feeds readers, services, topics and sockets with odd input; exit 0 only if nothing was found. Findings: logs/fuzz/.
#   MINUTES    how long (default 2)
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
