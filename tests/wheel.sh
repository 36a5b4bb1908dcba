#!/usr/bin/env bash
# Builds the sdist and the wheel from it; for each installed Python, installs the wheel in a fresh environment
# without constraints and runs simulate, attack and evaluate from an empty folder.
#
# attack and evaluate need PyTorch. If only its CUDA build of several gigabytes is available, it is not installed:
# then every dependency is resolved, simulate, inspect and verify run, and attack and evaluate must fail with a
# one-line error. ADVPIPE_WHEEL_CUDA=1 installs it anyway. PYTHONS="3.11 3.13" selects Python versions.
set -euo pipefail
cd "$(dirname "$0")/.."
torch_index=${TORCH_INDEX-https://download.pytorch.org/whl/cpu}
torch=torch==$(sed -n 's/^torch==//p' constraints.txt)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
unset PYTHONPATH PIP_CONSTRAINT PIP_REQUIRE_VIRTUALENV
pip_options=(--quiet --quiet --disable-pip-version-check)

main() {
    build
    local tested=0 version python
    for version in ${PYTHONS:-3.10 3.11 3.12 3.13 3.14}; do
        python=$(interpreter "$version") || { note "Python $version" "no interpreter found: not tested"; continue; }
        mkdir "$scratch/empty"
        # A function before `||` runs without `set -e`, so each Python runs in a separate shell.
        bash -euo pipefail -c "$(declare -f); $(declare -p torch torch_index scratch wheel pip_options); try $python" ||
            { note "Python $version" "FAILED; see the lines above"; exit 1; }
        tested=$((tested + 1))
        rm -rf "$scratch/venv" "$scratch/empty"
    done
    [ "$tested" -gt 0 ] || { note "wheel" "FAILED: no Python found"; exit 1; }
    note "wheel" "good with $tested versions of Python"
}

note() { printf 'wheel-test: %s: %s\n' "$1" "$2"; }

build() {
    "${PYTHON:-python3}" -m venv "$scratch/build"
    "$scratch/build/bin/pip" install "${pip_options[@]}" build
    mkdir "$scratch/source"  # setuptools would search all of .venv
    tar -c --exclude ./.venv --exclude ./.git --exclude ./datasets . | tar -x -C "$scratch/source"
    "$scratch/build/bin/python" -m build --outdir "$scratch/dist" "$scratch/source" > "$scratch/build.log" 2>&1 ||
        { cat "$scratch/build.log"; note "wheel" "FAILED: it cannot be built"; exit 1; }
    rm -rf "$scratch/build" "$scratch/source"
    wheel=$(echo "$scratch"/dist/advpipe-*.whl)
    note "wheel" "$(basename "$wheel"), $(du -k "$wheel" | cut -f1) kB, from the sdist"
}

interpreter() {  # VERSION: the path of an interpreter that starts; pyenv's shims often do not
    local found
    for found in "$(command -v "python$1" || true)" \
        "$(pyenv prefix "$(pyenv latest "$1" 2> /dev/null)" 2> /dev/null || true)/bin/python$1"; do
        if "$found" -c 'import venv' 2> /dev/null; then echo "$found"; return; fi
    done
    return 1
}

try() {  # PYTHON
    local start=$SECONDS name
    name="Python $("$1" -c 'import platform; print(platform.python_version())')"
    "$1" -m venv "$scratch/venv"
    PATH=$scratch/venv/bin:$PATH
    cd "$scratch/empty"
    if install_cpu_torch || [ -n "${ADVPIPE_WHEEL_CUDA:-}" ]; then
        pip install "${pip_options[@]}" "$wheel"
        all_commands
        note "$name" "simulate, attack and evaluate ran; $((SECONDS - start)) s, $(size_mb) MB"
    else
        pip install "${pip_options[@]}" --upgrade pip  # older versions download everything even in a dry run
        pip install "${pip_options[@]}" --dry-run "$wheel"
        without_torch
        commands_without_torch
        note "$name" "all dependencies resolve; simulate, inspect and verify ran, attack and evaluate did not, \
as PyTorch has no CPU build for it here; $((SECONDS - start)) s, $(size_mb) MB"
    fi
}

install_cpu_torch() {  # as `make install` does; fails if there is no CPU build
    local command=(pip install "${pip_options[@]}" --no-deps --retries 0 --index-url "$torch_index" "$torch")
    "${command[@]}" --dry-run --report torch.json 2> /dev/null || return 1
    ! grep -q '"nvidia-\|"cuda-' torch.json || return 1  # its requirements
    rm torch.json
    "${command[@]}" 2> /dev/null
}

size_mb() { du -sm "$scratch/venv" | cut -f1; }

without_torch() {  # installs the wheel with all its requirements except torch
    python - "$wheel" > requirements.txt << 'END'
import sys, zipfile
from email.parser import Parser
archive = zipfile.ZipFile(sys.argv[1])
(metadata,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
for line in Parser().parsestr(archive.read(metadata).decode()).get_all("Requires-Dist"):
    if "extra ==" not in line and not line.startswith("torch>"):
        print(line)
END
    pip install "${pip_options[@]}" -r requirements.txt
    pip install "${pip_options[@]}" --no-deps "$wheel"
    rm requirements.txt
}

all_commands() {
    recorded
    silently advpipe attack --type detach --ratio 0.01 --frames 0:2
    silently advpipe evaluate --baseline-tries 2
    test -s datasets/smoke/reports/small/report.html
}

commands_without_torch() {
    recorded
    silently advpipe inspect datasets/smoke/clean
    silently advpipe verify datasets/smoke
    local command line
    for command in attack evaluate; do
        if line=$(advpipe $command 2>&1); then echo "$command ran without torch"; return 1; fi
        line=$(grep -v ' \.\.\.$' <<< "$line")  # what it is about to do, said before PyTorch is imported
        [[ $line == "advpipe: the Python package torch is missing"* && $(wc -l <<< "$line") = 1 ]] ||
            { echo "$command did not fail with a one-line error about torch: $line"; return 1; }
    done
}

recorded() {
    advpipe --version > /dev/null
    silently advpipe simulate smoke
    test -s datasets/smoke/clean/clean_0.mcap
}

silently() {  # COMMAND...: shows its output only if it fails or warns
    "$@" > output.txt 2> errors.txt || { cat output.txt errors.txt; return 1; }
    if grep -i "warning" output.txt errors.txt; then return 1; fi
}

main
