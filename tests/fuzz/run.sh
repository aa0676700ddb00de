#!/bin/sh
# Runs each reader under libFuzzer for so many seconds (default 900): tests/fuzz/run.sh [SECONDS] [READER...]
# What it starts from are the files of tests/golden and tests/corpus; what crashes a reader,
# or takes it longer than 20 s, is left in build/fuzz/found and ends the run with 1. A finding that is
# repaired moves to tests/corpus.
set -eu
cd "$(dirname "$0")/../.."
seconds=${1-900}
[ $# -gt 0 ] && shift
build=build/fuzz
readers=${*:-linuxcnc fanuc siemens heidenhain cl auto tools offsets pvt}

# starts READER: the files that it starts from
starts() {
  case $1 in
    linuxcnc) cat_all tests/golden/linuxcnc_*/program.* tests/golden/nc_*/program.* tests/corpus/dialects/linuxcnc_* ;;
    fanuc | siemens | heidenhain | cl) cat_all tests/golden/"$1"_*/program.* tests/corpus/dialects/"$1"_* ;;
    auto) cat_all tests/golden/*/program.* tests/corpus/dialects/* ;;
    tools | offsets) cat_all tests/corpus/tables/"$1"_* ;;
    pvt) cat_all tests/corpus/pvt/* ;;
  esac
}
cat_all() { for one in "$@"; do [ -f "$one" ] && printf '%s\n' "$one"; done; true; }

failed=
mkdir -p "$build/found"
for reader in $readers; do
  seeds=$build/seeds/$reader grown=$build/grown/$reader
  rm -rf "$seeds"
  mkdir -p "$seeds" "$grown"
  n=0
  for file in $(starts "$reader"); do
    n=$((n + 1))
    cp "$file" "$seeds/$n"
  done
  echo "$reader: $n files to start from, $seconds s"
  "$build/tests/fuzz/${reader}_fuzz" "$grown" "$seeds" -max_total_time="$seconds" -timeout=20 \
    -rss_limit_mb=4096 -max_len=8192 -artifact_prefix="$build/found/${reader}_" -print_final_stats=1 \
    >"$build/found/$reader.log" 2>&1 || failed="$failed $reader"
  grep -E 'number_of_executed_units|new_units_added|peak_rss_mb|SUMMARY|Done ' "$build/found/$reader.log" || true
done
[ -z "$failed" ] || { echo "failed:$failed (build/fuzz/found)" >&2; exit 1; }
