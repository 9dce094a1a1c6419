#!/usr/bin/env bash
# Fetches the vendored libraries from npm and bundles them as they are in this folder; `vendor.sh --check` compares instead of writing.
# Needs node, npm and the npm registry. Versions are exact, and npm verifies the integrity that is written here.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
echo '{"private":true}' >package.json
npm install --silent --no-audit --no-fund --ignore-scripts ogl@1.0.11 uplot@1.6.32 esbuild@0.28.2
integrity() {
    node -e 'const l=require("./package-lock.json").packages["node_modules/'"$1"'"].integrity; process.exit(l===process.argv[1]?0:1)' "$2" ||
        { echo "$1: another integrity than $2" >&2; exit 1; }
}
integrity ogl sha512-kUpC154AFfxi16pmZUK4jk3J+8zxwTWGPo03EoYA8QPbzikHoaC82n6pNTbd+oEaJonaE8aPWBlX7ad9zrqLsA==
integrity uplot sha512-KIMVnG68zvu5XXUbC4LQEPnhwOxBuLyW1AHtpm6IKTXImkbLgkMy+jabjLgSLMasNuGGzQm/ep3tOkyTxpiQIw==
cp "$here/ogl-entry.js" .
node_modules/@esbuild/*/bin/esbuild ogl-entry.js --bundle --minify --format=iife --global-name=OGL --target=es2020 --log-level=error \
    --banner:js='/* OGL 1.0.11, github.com/oframe/ogl, Unlicense (public domain) */' --outfile=ogl.min.js
{ echo '/* uPlot 1.6.32, github.com/leeoniya/uPlot, MIT, (c) 2022 Leon Sorokin */'; sed 1d node_modules/uplot/dist/uPlot.iife.min.js; } >uplot.min.js
{ echo '/* uPlot 1.6.32, github.com/leeoniya/uPlot, MIT, (c) 2022 Leon Sorokin */'; cat node_modules/uplot/dist/uPlot.min.css; } >uplot.min.css
cp node_modules/uplot/LICENSE uplot.LICENSE
files=(ogl.min.js uplot.min.js uplot.min.css uplot.LICENSE)
if [ "${1:-}" = --check ]; then
    for f in "${files[@]}"; do cmp "$f" "$here/$f"; done
    echo "the vendored files are those of npm"
else
    cp "${files[@]}" "$here/"
    cd "$here" && sha256sum "${files[@]}" >SHA256SUMS
fi
