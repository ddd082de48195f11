#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Writes the API reference, one part a package, from the docstrings to api_docs/. A warning is an error.
#   tools/docs.sh [PACKAGE ...]     only these packages
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

[ $# -gt 0 ] || set -- m2wr_campaign m2wr_course m2wr_delivery m2wr_elevation m2wr_exploration m2wr_files m2wr_gmapping m2wr_live m2wr_lockstep m2wr_maps m2wr_navigation m2wr_node m2wr_nodelet m2wr_sim m2wr_tools m2wr_view motion_plan
command -v sphinx-build >/dev/null || die "sphinx-build is not on PATH; run make setup, or install python3-sphinx."

pages=$(mktemp -d)
trap 'rm -rf "$pages"' EXIT
cp "$WORKSPACE/tools/docs/conf.py" "$pages"
{
    printf 'API reference\n=============\n\n.. toctree::\n   :maxdepth: 1\n\n'
    printf '   %s/modules\n' "$@"
} > "$pages/index.rst"

paths=$(printf '%s:' "$VENV"/lib/python3*/site-packages)
for folder in "$WORKSPACE"/src/*/src; do
    paths=$paths:$folder
done
for package in "$@"; do
    sources=$WORKSPACE/src/$package/src/$package
    [ -d "$sources" ] || die "there is no $sources; expected the name of a package with a Python package."
    sphinx-apidoc --separate --module-first --maxdepth 1 --doc-project "$package" \
        --output-dir "$pages/$package" "$sources" >/dev/null
done
rm -rf "$WORKSPACE/api_docs"
PYTHONPATH=$paths PYTHONDONTWRITEBYTECODE=1 "$PYTHON" -m sphinx -W --keep-going -q -b html "$pages" "$WORKSPACE/api_docs"
rm -rf "$WORKSPACE/api_docs/.doctrees"
say "API reference: $WORKSPACE/api_docs/index.html"
