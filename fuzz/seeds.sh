#!/usr/bin/env bash
# seeds.sh FOLDER: writes the first corpus of every fuzz target into FOLDER/<target>.
set -euo pipefail
mkdir -p "$1"
corpus=$(cd "$1" && pwd)
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# The fixtures of the readers' tests.
CALIB_FUZZ_SEEDS=$corpus cargo test -q -p calib-recording -p calib-capture fuzz_seeds
mkdir -p "$corpus"/{profile,urdf_round_trip,change_record,model_file}
cp robots/*.yaml "$corpus/profile"
results=$(mktemp -d)
trap 'rm -rf "$results"' EXIT
for robot in ripley justin; do
  cargo run -q --release -p calib-cli -- run "robots/$robot.yaml" --out "$results/$robot" >/dev/null
  cp robots/"$robot"/*.urdf "$corpus/urdf_round_trip"
  cp "$results/$robot"/*.urdf "$corpus/urdf_round_trip"
  cp "$results/$robot"/*.model.json "$corpus/model_file"
  for record in "$results/$robot"/*.changes.json; do
    { tr -d '\n' <"$record"; echo; cat "${record%.changes.json}"; } >"$corpus/change_record/$(basename "$record")"
  done
done
