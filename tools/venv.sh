# SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=bash
# shellcheck disable=SC2034  # the variable is read by the scripts that source this file
# Sourced after common.sh by the scripts that make a Python venv.

LINT_VENV=$WORKSPACE/.venv_lint

# True if a venv has exactly the pinned version of every distribution in a file of requirements.
venv_is_current() {
    [ -x "$1/bin/python" ] && pins "$2" | "$1/bin/python" -c '
import sys
try:
    from importlib.metadata import PackageNotFoundError, version
except ImportError:
    sys.exit(1)
for line in sys.stdin:
    name, _, pinned = line.strip().partition("==")
    try:
        if version(name) != pinned:
            sys.exit(1)
    except PackageNotFoundError:
        sys.exit(1)
'
}

# Makes a venv with the pinned distributions of a file of requirements, if it does not exist yet.
#   make_venv FOLDER REQUIREMENTS [option of python3 -m venv ...]
make_venv() {
    local venv=$1 requirements=$2
    shift 2
    if venv_is_current "$venv" "$requirements"; then
        say "venv ${venv##*/}: up to date"
        return
    fi
    say "venv ${venv##*/}: $venv from $requirements"
    "$PYTHON" -m venv --clear "$@" "$venv"
    # without dependencies: pip must not install a second numpy, lxml or yaml over those of the system
    "$venv/bin/python" -m pip --disable-pip-version-check install --quiet --no-deps --require-hashes --retries 5 \
        -r "$requirements"
}
