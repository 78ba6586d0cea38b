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

# program NAME COMMAND: a checker that is a script of node.
program() {
  printf '#!/bin/sh\nexec %s "$@"\n' "$2" >"$folder/$1"
  chmod +x "$folder/$1"
}
if command -v npm >/dev/null && (cd "$folder" && npm install --no-audit --no-fund --silent \
  gltf-validator@2.0.0-dev.3.10 html-validate@10.17.0 axe-core@4.14.1 \
  @mcap/core@2.2.2 @foxglove/schemas@2.1.0 ajv@8.17.1 >>install.log 2>&1); then
  cp "$here/gltf.js" "$here/axe.js" "$here/mcap.js" "$folder"
  program gltf "node \"$folder/gltf.js\""
  program mcap "node \"$folder/mcap.js\""
  program html "\"$folder/node_modules/.bin/html-validate\""
  browser=$(command -v chromium || command -v chromium-browser || command -v google-chrome) \
    && program axe "node \"$folder/axe.js\" \"$browser\""
fi

# A Python with what reads outputs: MuJoCo the MJCF, Pinocchio the URDF, an independent OPW the parameters of six-axis arms, Arrow tables.
if command -v python3 >/dev/null && python3 -m venv "$folder/python" >>"$folder/install.log" 2>&1; then
  for checker in mujoco:mujoco==4.0.0 pinocchio:pin==4.1.0 opw:py-opw-kinematics==1.3.0 pyarrow:pyarrow==26.0.1; do
    "$folder/python/bin/pip" install -q "${checker#*:}" >>"$folder/install.log" 2>&1 \
      && program "${checker%%:*}" "\"$folder/python/bin/python\""
  done
  # Manifests against the schemas of Kubernetes; unknown keys are faults.
  "$folder/python/bin/pip" install -q kubernetes-validate==1.37.0 >>"$folder/install.log" 2>&1 \
    && program kubernetes "\"$folder/python/bin/kubernetes-validate\" --strict"
fi

for checker in urdf sdf gltf mcap html axe mujoco pinocchio opw pyarrow kubernetes; do
  [ -x "$folder/$checker" ] && echo "$checker" || echo "no checker of $checker here"
done
