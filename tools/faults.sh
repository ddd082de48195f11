#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# The long form of the fault tests: every case, MOMENTS interrupts of every launch file, PAIRS runs under load.
#   MOMENTS  interrupts of each launch file at seeded random moments (default 100)
#   PAIRS    pairs of runs that must be equal on a loaded machine (default 10)
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

enter_run_environment
cd "$WORKSPACE"
use_loopback
failed=0
M2WR_FAULTS=all MOMENTS=${MOMENTS:-100} "$PYTHON" -m pytest -v --color=no --tb=short test/faults || failed=1
"$PYTHON" test/faults/repeat_under_load --pairs "${PAIRS:-10}" || failed=1
exit $failed
