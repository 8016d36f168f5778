#!/bin/sh
# Builds the fuzz targets, which are one program, and runs each for SECONDS (default 30), or only those named, as many at once
# as there are processors:
#     fuzz/run.sh [SECONDS [TARGET ..]]
# Works with the stable compiler, without cargo-fuzz: libFuzzer comes with the crate libfuzzer-sys,
# the coverage it needs from rustc's own passes. Fails if a target finds something,
# and leaves the input under fuzz/artifacts/.
#
# To add a target: src/targets/NAME.rs, its name in src/targets.rs, and what it should start from
# under seeds/: NAME.hex (one seed per line, # begins a comment), files in NAME/, or NAME.files, which
# names files of the project, one pattern per line. Longest input: 2048 bytes, or what NAME.files begins
# with as `max_len N`.
set -eu
cd "$(dirname "$0")"
target=$(rustc -vV | sed -n 's/^host: //p')

# One target, which is built: this script calls itself.
if [ "${1:-}" = one ]; then
    seconds=$2 name=$3
    corpus=corpus/$name
    mkdir -p "$corpus" artifacts
    [ ! -d "seeds/$name" ] || cp "seeds/$name/"* "$corpus/"
    if [ -f "seeds/$name.hex" ]; then
        sed 's/#.*//; s/ //g; /^$/d' "seeds/$name.hex" | {
            line=0
            while read -r hex; do
                line=$((line + 1))
                # Octal is what every printf knows.
                bytes=$(echo "$hex" | fold -w 2 | while read -r byte; do
                    printf '\\0%o' "0x$byte"
                done)
                printf '%b' "$bytes" > "$corpus/seed-$line"
            done
        }
    fi
    longest=2048
    if [ -f "seeds/$name.files" ]; then
        while read -r pattern rest; do
            case $pattern in
            max_len) longest=$rest ;;
            *) cp ../$pattern "$corpus/" ;;
            esac
        done < "seeds/$name.files"
    fi
    GAITWAY_FUZZ=$name "target/$target/release/gaitway-fuzz" "$corpus" -max_total_time="$seconds" -max_len="$longest" \
        -timeout=5 -rss_limit_mb=1024 -print_final_stats=1 -artifact_prefix="artifacts/$name-" \
        2> "artifacts/$name.log" || { tail -40 "artifacts/$name.log"; exit 1; }
    # In one piece: others are told at the same time.
    found=$(grep -E "DONE|number_of_executed_units|average_exec_per_sec" "artifacts/$name.log")
    printf '== %s, %s s\n%s\n' "$name" "$seconds" "$found"
    exit
fi

seconds=${1:-30}
[ $# -gt 0 ] && shift
[ $# -gt 0 ] || set -- $(ls src/targets | sed 's/\.rs$//')

RUSTFLAGS="-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
-Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
-Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=8 -Cdebug-assertions \
-Coverflow-checks" \
    cargo build --release --target "$target" --target-dir target

printf '%s\n' "$@" | xargs -P "$(nproc)" -I NAME sh run.sh one "$seconds" NAME
