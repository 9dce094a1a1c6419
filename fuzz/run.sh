#!/usr/bin/env bash
# Fuzzes every reader, one after the other:
#
#   fuzz/run.sh [minutes per target, 20] [target...]
#
# Needs a nightly compiler (rustup toolchain install nightly) and cargo-fuzz (cargo install cargo-fuzz). Starts from fuzz/seeds and the
# fixtures, keeps what it learns in fuzz/corpus and what it finds in fuzz/artifacts; both stay out of the repository. A
# finding becomes a regression test: minimise it (cargo +nightly fuzz tmin) and put it into fuzz/seeds/<target>, which
# `cargo xtask test` runs (crates/ffid/tests/any_bytes.rs).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
minutes=${1:-20}
shift || true
targets=("$@")
[ ${#targets[@]} -gt 0 ] || targets=(urdf mission csv binary result trajectory)
for target in "${targets[@]}"; do
    corpus=fuzz/corpus/$target
    mkdir -p "$corpus"
    for seed in fuzz/seeds/"$target"/*; do [ -e "$seed" ] && cp -n "$seed" "$corpus"; done
    case $target in
        urdf) cp -n fixtures/paper/*.urdf fixtures/bad/*.urdf "$corpus" ;;
        mission) cp -n fixtures/paper/*.toml fixtures/bad/*.toml "$corpus" ;;
        binary) cp -n fixtures/records/*.parquet fixtures/records/*.mcap "$corpus" ;;
    esac
    echo "=== $target, $minutes min"
    cargo +nightly fuzz run "$target" "$corpus" -- -max_total_time=$((60 * minutes)) -timeout=20 -rss_limit_mb=1024 -print_final_stats=1
done
