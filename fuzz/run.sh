#!/usr/bin/env bash
# Fuzzes every reader, one after the other:
#
#   fuzz/run.sh [minutes per target, 20] [target...]
#
# Needs cargo-fuzz (cargo install cargo-fuzz) and a C++ compiler, and takes a nightly compiler where there is one (rustup toolchain
# install nightly); without, the stable one is allowed the flags of the sanitisers, which it has as well. Starts from fuzz/seeds
# and the fixtures, keeps what it learns in fuzz/corpus and what it finds in fuzz/artifacts; both stay out of the repository. Goes on
# to the next target after a finding, and ends with exit code 1 if there was one. A finding becomes a regression test: minimise
# it (cargo fuzz tmin) and put it into fuzz/seeds/<target>, which `cargo xtask test` runs (crates/ffid-cli/tests/any_bytes.rs).
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
minutes=${1:-20}
shift || true
targets=("$@")
[ ${#targets[@]} -gt 0 ] || targets=(urdf mission csv binary result trajectory)
if ! cargo fuzz --version >/dev/null 2>&1; then
    echo "no cargo-fuzz: cargo install cargo-fuzz" >&2
    exit 20
fi
fuzz=(cargo fuzz)
if cargo +nightly --version >/dev/null 2>&1; then
    fuzz=(cargo +nightly fuzz)
else
    export RUSTC_BOOTSTRAP=1
fi
found=0
for target in "${targets[@]}"; do
    corpus=fuzz/corpus/$target
    mkdir -p "$corpus"
    for seed in fuzz/seeds/"$target"/*; do [ -e "$seed" ] && cp -n "$seed" "$corpus"; done
    case $target in
        urdf) cp -n fixtures/paper/*.urdf fixtures/bad/*.urdf "$corpus" ;;
        mission) cp -n fixtures/paper/*.toml fixtures/kinds/*.toml fixtures/bad/*.toml "$corpus" ;;
        binary) cp -n fixtures/records/*.parquet fixtures/records/*.mcap "$corpus" ;;
    esac
    echo "=== $target, $minutes min"
    "${fuzz[@]}" run "$target" "$corpus" -- -max_total_time=$((60 * minutes)) -timeout=20 -rss_limit_mb=1024 -print_final_stats=1 || found=1
done
exit $found
