#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Makes the pictures of README files and docs/ again, without a display. GALLERY names documents; default: all.
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

enter_run_environment
cd "$WORKSPACE"
read -r -a documents <<< "${GALLERY:-}"
exec "$PYTHON" tools/gallery.py "${documents[@]}"
