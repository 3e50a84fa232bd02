#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Compiles each requirements*.in into its .txt: every version and hash, and no address that packages come from,
# so that any index or mirror serves them. Extra arguments go to uv: `--upgrade` takes the newest versions.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

for source in requirements.in requirements-uv.in; do
  target=${source%.in}.txt
  uv pip compile -q --generate-hashes --no-emit-index-url --no-emit-find-links --no-annotate --no-header \
    --python-version 3.13 --python-platform x86_64-manylinux_2_28 "$@" "$source" --output-file "$target" >/dev/null
  ! grep -n '://' "$target" || { echo "$target records an address" >&2; exit 1; }
  sed -i "1i # Compiled from $source by \`make requirements\`: every version and hash. Not edited by hand." "$target"
  echo "$target: $(grep -c '==' "$target") packages"
done
