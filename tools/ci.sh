#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# What .ci/run does. The steps run in a fresh minimal Debian 12 that is made for them and removed afterwards
# (tools/fresh_root.sh), so that they do not depend on packages installed on this machine by chance:
#   1. a user with sudo runs the first step (`make setup`) there, as a new user does on a new machine;
#   2. root runs all steps there, as a container does: set-up again (which changes nothing), lint, docs, test, demo.
# Where no such root can be made, a warning gives the reason and the steps run on this machine.
# The last line is the test summary; the exit code is that of the step that failed, 124 when CI_LIMIT was reached.
#   CI_STEPS   steps, separated by blanks (default: setup lint docs test demo); variables of the Makefile are passed on
#   CI_ROOT    `host` runs the steps on this machine; with `fresh` it is an error if no root can be made
#   CI_FOLDER  folder in which the root is made; it takes about 6 GB (default: TMPDIR, or /var/tmp)
#   CI_LIMIT   seconds after which everything is ended (default 5100: TEST_TIMEOUT, and the other steps on a slow machine)
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
# shellcheck source=tools/fresh_root.sh
source "$WORKSPACE/tools/fresh_root.sh"

exec < /dev/null
export CI=${CI:-true}
read -r -a STEPS <<< "${CI_STEPS:-setup lint docs test demo}"
SUMMARY=$RESULTS/summary.txt

run_steps() {
    local step started status
    cd "$WORKSPACE"
    for step in "${STEPS[@]}"; do
        started=$SECONDS status=0
        progress "make $step, as $(id -un)"
        make "$step" || status=$?
        if [ $status -ne 0 ]; then
            progress "make $step: FAILED with exit code $status after $((SECONDS - started)) s"
            return $status
        fi
        progress "make $step: passed after $((SECONDS - started)) s"
    done
}

# The last lines: the result and, if the tests ran, their summary.
tell() {
    progress "ended after $SECONDS s with exit code $1"
    if [ -r "$SUMMARY" ]; then
        cat "$SUMMARY"
    elif [[ " ${STEPS[*]} " == *" test "* ]]; then
        echo "the tests did not run"
    fi
}

main() {
    local status=0 obstacle
    rm -f "$SUMMARY"
    obstacle=$(why_no_fresh_root)
    if [ -z "$obstacle" ]; then
        run_in_fresh_root || status=$?
    elif [ "${CI_ROOT:-}" = fresh ]; then
        die "no fresh root: $obstacle"
    else
        printf '\nWARNING: no fresh root: %s\n' "$obstacle" >&2
        printf 'WARNING: the steps run on this machine; they do not prove that the set-up installs everything.\n' >&2
        (set -e; run_steps) || status=$?
    fi
    tell "$status"
    exit "$status"
}

case ${1:-} in
    "") main ;;
    --steps) run_steps ;;
    --inside) inside "$2" ;;
    *) die "ci.sh: unknown argument: $1" ;;
esac
