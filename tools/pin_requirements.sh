#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Updates the hashes in tools/requirements*.txt: those of every file on PyPI for each pinned version, so that they
# cover other processors and Pythons. Run it after a version was changed; needs uv on PATH
# (python3 -m pip install uv).
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

command -v uv >/dev/null || die "uv is not on PATH; python3 -m pip install uv, in a venv"
for file in "$WORKSPACE"/tools/requirements*.txt; do
    new=$(mktemp)
    sed -n '/^#/p; /^[^#]/q' "$file" > "$new"
    pins "$file" | uv pip compile --quiet --no-config --index-url https://pypi.org/simple --no-deps --universal \
        --python-version 3.8.10 --no-python-downloads --generate-hashes --no-annotate --no-header - >> "$new"
    cat "$new" > "$file"
    rm "$new"
    say "$file: $(pins "$file" | wc -l) versions, $(grep -c sha256: "$file") hashes"
done
