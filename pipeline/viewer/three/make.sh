#!/usr/bin/env bash
# Makes three.min.js anew: the parts of three.js that the viewer uses, in one script that begins with its
# licence, since pages carry it away. Needs npm and the network; package-lock.json pins what is fetched by
# checksum, so that the same bytes come out. `make viewer` calls it.
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cp "$here"/{package.json,package-lock.json,parts.js} "$work"
cd "$work"
npm ci --ignore-scripts --no-audit --no-fund --silent
version="$(node -p 'require("./node_modules/three/package.json").version')"
node_modules/.bin/esbuild parts.js --bundle --minify --format=iife --global-name=THREE --target=es2020 \
    --charset=ascii --log-level=warning --outfile=bundle.js
{
    printf '/*!\nthree.js %s, parts of it in one script. ' "$version"
    cat node_modules/three/LICENSE
    printf '*/\n'
    cat bundle.js
} > three.min.js
cp node_modules/three/LICENSE "$here/LICENSE.txt"
cp three.min.js "$here/three.min.js"
sha256="$(sha256sum three.min.js | cut -d' ' -f1)"
printf '{\n  "name": "three.js",\n  "version": "%s",\n  "license": "MIT",\n  "sha256": "%s"\n}\n' \
    "$version" "$sha256" > "$here/version.json"
