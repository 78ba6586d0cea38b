#!/usr/bin/env bash
# Tests `--store` against a server that speaks S3: store.sh FOLDER. The server is moto, in a virtual environment of the folder; where it cannot be had,
# only a folder is tested as a store.
set -euo pipefail
mkdir -p "$1"
folder=$(cd "$1" && pwd)
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
fail() { printf 'error: %s\n' "$*" >&2; exit 1; }

server=
trap '[ -z "$server" ] || kill "$server" 2>/dev/null || true' EXIT
port=$(python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
export AWS_ACCESS_KEY_ID=test AWS_SECRET_ACCESS_KEY=test AWS_REGION=us-east-1 AWS_ENDPOINT=http://127.0.0.1:$port
# No proxy stands between this machine and itself.
export NO_PROXY=127.0.0.1 no_proxy=127.0.0.1

# start: an empty server with a bucket.
start() {
  "$folder/moto/bin/moto_server" -H 127.0.0.1 -p "$port" >>"$folder/moto.log" 2>&1 &
  server=$!
  "$folder/moto/bin/python" - <<EOF
import time, boto3
store = boto3.client("s3", endpoint_url="$AWS_ENDPOINT")
for _ in range(100):
    try:
        store.create_bucket(Bucket="calib")
        break
    except Exception:
        time.sleep(0.2)
else:
    raise SystemExit("the server does not answer")
EOF
}

if python3 -m venv "$folder/moto" >>"$folder/install.log" 2>&1 \
  && "$folder/moto/bin/pip" install -q --disable-pip-version-check 'moto[server]==5.2.5' >>"$folder/install.log" 2>&1; then
  start
  export CALIB_S3=s3://calib/tests
  url=s3://calib/run
else
  echo "no server of S3: only a folder is tested as a store"
  url=file://$folder/store
fi

# The features of a whole build, so that nothing is built twice: in it the program knows stores, as that of the Python package does.
cargo test --workspace --test it --test suite stores
calib=${CARGO_TARGET_DIR:-target}/debug/calib
study=(study aor --trials 1 --seed 1)

# Machines that share nothing but the store, and what they make together.
"$calib" "${study[@]}" --out "$folder/quiet" --quiet >/dev/null
for part in 1 2 3; do
  "$calib" "${study[@]}" --shard "$part/3" --out "$folder/machine-$part" --store "$url" --quiet >/dev/null
  [ "$part" != 2 ] || rm -r "$folder/machine-$part"
done
"$calib" merge --store "$url" --out "$folder/all.parquet" --quiet >/dev/null
"$calib" "${study[@]}" --from "$folder/all.parquet" --out "$folder/again" --quiet >/dev/null
# What is kept to continue is not a result.
diff -r --exclude="*.jsonl" "$folder/quiet" "$folder/again" || fail "shards of a store give other bytes"
[ -z "$(find "$folder" -maxdepth 1 -name '.*' ! -name '.' ! -name '.calib*lock*')" ] || fail "the merge left files behind"

# What is not there, or not whole, is named with its address.
code=0; said=$("$calib" merge --store "$url/elsewhere" --out "$folder/none.parquet" 2>&1) || code=$?
case $code:$said in 3:*"$url/elsewhere: holds no shards"*) ;; *) fail "an empty store: $code, $said" ;; esac

if [ -n "$server" ]; then
  # Without the store nothing is calculated; when it is there again, nothing was lost.
  kill "$server"; wait "$server" 2>/dev/null || true; server=
  code=0; said=$("$calib" "${study[@]}" --shard 1/3 --out "$folder/machine-4" --store "$url" 2>&1) || code=$?
  case $code:$said in 3:*"$url/aor-1-of-3.parquet: cannot be read"*) ;; *) fail "a store that is gone: $code, $said" ;; esac
  start
  "$calib" "${study[@]}" --shard 1/3 --out "$folder/machine-1" --store "$url" --quiet >/dev/null
  code=0; said=$("$calib" merge --store "$url" --out "$folder/none.parquet" 2>&1) || code=$?
  case $code:$said in 3:*"2 and 3 are missing"*) ;; *) fail "one shard of three: $code, $said" ;; esac
fi
echo "shards of a store give the bytes of the undivided study"
