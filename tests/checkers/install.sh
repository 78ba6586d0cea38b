#!/usr/bin/env bash
# Puts the reference checkers of the output formats into a folder: install.sh FOLDER. The tests find them where CALIB_CHECKERS
# names that folder; a checker that cannot be installed here is left out and its tests are counted as skipped.
set -uo pipefail
mkdir -p "$1"
folder=$(cd "$1" && pwd)
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

packages() {
  if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    apt-get install -y -qq --no-install-recommends "$@" >>"$folder/install.log" 2>&1
  fi
}

command -v check_urdf >/dev/null || packages liburdfdom-tools
if command -v check_urdf >/dev/null; then
  ln -sf "$(command -v check_urdf)" "$folder/urdf"
fi

library() { pkg-config --list-all 2>/dev/null | grep -o '^sdformat[0-9]*' | sort -V | tail -1; }
[ -n "$(library)" ] || packages libsdformat-dev pkg-config g++
if [ -n "$(library)" ]; then
  # shellcheck disable=SC2046
  g++ -std=c++17 "$here/sdf.cc" -o "$folder/sdf" $(pkg-config --cflags --libs "$(library)") >>"$folder/install.log" 2>&1
fi

if command -v npm >/dev/null && (cd "$folder" && npm install --no-audit --no-fund --silent gltf-validator@2.0.0-dev.3.10 >>install.log 2>&1); then
  cp "$here/gltf.js" "$folder/gltf.js"
  printf '#!/bin/sh\nexec node "%s/gltf.js" "$@"\n' "$folder" >"$folder/gltf"
  chmod +x "$folder/gltf"
fi

for checker in urdf sdf gltf; do
  [ -x "$folder/$checker" ] && echo "$checker" || echo "no checker of $checker here"
done
