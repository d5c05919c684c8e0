#!/usr/bin/env bash
# Fuzzes one target for so many seconds: tests/fuzz/run.sh TARGET [SECONDS]. Finds go to tests/fuzz/artifacts,
# what covers new code to tests/fuzz/corpus. tests/fuzz/run.sh TARGET merge adds the least of it to the seeds.
set -euo pipefail
cd "$(dirname "$0")/../.."
target=$1 seconds=${2:-600}
here=tests/fuzz corpus=tests/fuzz/corpus/$1
mkdir -p "$corpus"
# None may take 512 MB, nor a time that no busy host explains: they take milliseconds.
limits=(-timeout=25 -rss_limit_mb=512)
fuzz=(cargo fuzz run --fuzz-dir "$here" --sanitizer none "$target")
if [ "$seconds" = merge ]; then
    # Short ones, and one for each branch whatever its counts: the seeds of all targets stay below 200 kB.
    exec "${fuzz[@]}" "$here/seeds/$target" "$corpus" -- "${limits[@]}" -max_len=1000 -set_cover_merge=1 -use_counters=0
fi
# Longer inputs find no more and take longer.
exec "${fuzz[@]}" "$corpus" "$here/seeds/$target" -- "${limits[@]}" -max_len=4096 -dict="$here/keys.dict" -fork=0 -max_total_time="$seconds"
