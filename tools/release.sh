#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Commits and tags a release: "Forthcoming" in each CHANGELOG.rst becomes a version with its date. Nothing is pushed.
#   tools/release.sh --bump minor       options of catkin_prepare_release
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

cd "$WORKSPACE"
[ -z "$(git status --porcelain)" ] || die "the checkout has changes; expected a clean one in which .ci/run has passed."
# stand-ins have the versions of the packages that they stand in for
: > dropin/CATKIN_IGNORE
trap 'rm -f dropin/CATKIN_IGNORE' EXIT
catkin_prepare_release --no-push "$@"
