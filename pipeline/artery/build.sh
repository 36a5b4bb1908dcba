#!/bin/sh
# Builds Artery with advpipe's module: some 25 minutes on two cores. See docs/artery.md.
#
#   build.sh [--sources DIR] [--into DIR] [--jobs N] [--accept-omnetpp-license]
#
# --sources: a folder with omnetpp/ (5.6.2) and artery/ (with its submodules inet, vanetza and veins); by
# default both are cloned into it. They are built where they lie. --into: where to write advpipe-artery, the
# program that `artery.program` of a scenario, or ADVPIPE_ARTERY_BIN, names.
set -eu

module=$(cd "$(dirname "$0")/module" && pwd)
sources=$PWD/artery-sources into='' jobs=$(nproc 2>/dev/null || echo 2) accepted=no
artery_commit=e0ddd8c0414b079f28e8efa932f52f66ae5a3c73

fail() { echo "build.sh: $*" >&2; exit 1; }
while [ $# -gt 0 ]; do
    case $1 in
        --sources | --into | --jobs) [ $# -gt 1 ] || fail "$1 needs a value" ;;
    esac
    case $1 in
        --sources) sources=$2; shift 2 ;;
        --into) into=$2; shift 2 ;;
        --jobs) jobs=$2; shift 2 ;;
        --accept-omnetpp-license) accepted=yes; shift ;;
        *) fail "unknown option $1; the head of this file lists them" ;;
    esac
done

if [ $accepted = no ]; then
    echo "OMNeT++ is free for academic and other non-commercial use under its Academic Public License"
    echo "(https://omnetpp.org/intro/license); companies need a licence of OMNEST."
    printf "Do you accept it? [yes/no] "
    read -r answer || answer=no
    [ "$answer" = yes ] || fail "not accepted: nothing was built"
fi
for tool in git cmake make g++ bison flex perl python3 pkg-config; do
    command -v $tool >/dev/null || fail "$tool is missing; docs/artery.md lists the packages"
done

mkdir -p "$sources"
sources=$(cd "$sources" && pwd)
omnetpp=$sources/omnetpp artery=$sources/artery
# What is interrupted here is left as NAME.part, and begun again: a folder of the final name is whole.
if [ ! -d "$omnetpp" ]; then
    rm -rf "$omnetpp.part"
    git clone --depth 1 --branch omnetpp-5.6.2 https://github.com/omnetpp/omnetpp "$omnetpp.part"
    mv "$omnetpp.part" "$omnetpp"
fi
if [ ! -d "$artery" ]; then
    rm -rf "$artery.part"
    git init --quiet "$artery.part"
    git -C "$artery.part" fetch --depth 1 https://github.com/riebl/artery $artery_commit
    git -C "$artery.part" checkout --quiet $artery_commit
    mv "$artery.part" "$artery"
fi
grep -q 'omnetpp-5\.6\.' "$omnetpp/Version" || fail "$omnetpp is not OMNeT++ 5.6: $(cat "$omnetpp/Version")"
for part in inet/src vanetza/vanetza veins/src; do
    [ -d "$artery/extern/$part" ] || [ ! -e "$artery/.git" ] ||
        git -C "$artery" submodule update --init --force --depth 1 "extern/${part%%/*}"
    [ -d "$artery/extern/$part" ] || fail "$artery/extern/${part%%/*} is empty; get Artery's submodules"
done

# OMNeT++: the simulation kernel and Cmdenv, without any window
cd "$omnetpp"
link_flags=
if [ ! -s src/common/sqlite3.c ]; then # some copies lack this large file: the system's library replaces it
    : >src/common/sqlite3.c
    link_flags='-Wl,--no-as-needed -lsqlite3'
fi
cat >configure.user <<END
PREFER_CLANG=no
WITH_TKENV=no
WITH_QTENV=no
WITH_OSG=no
WITH_OSGEARTH=no
WITH_PARSIM=no
WITH_SYSTEMC=no
WITH_NETBUILDER=yes
SHARED_LIBS=yes
PREFER_SQLITE_RESULT_FILES=no
CFLAGS_RELEASE='-O2 -DNDEBUG=1'
LDFLAGS='$link_flags'
END
PATH=$omnetpp/bin:$PATH LD_LIBRARY_PATH=$omnetpp/lib
export PATH LD_LIBRARY_PATH
[ -f Makefile.inc ] || ./configure
make -j"$jobs" base MODE=release

# INET: only what Artery's radio needs
cd "$artery/extern/inet"
./inet_featuretool disable -f all >/dev/null 2>&1 || true # it complains about features that riebl's branch lacks
./inet_featuretool enable -f mobility power radio idealwireless physicalenvironment Ieee80211 >/dev/null 2>&1 || true

# Artery and our module
cmake -S "$artery" -B "$artery/build" -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_CXX_FLAGS_RELEASE="${ARTERY_CXX_FLAGS:--O1 -DNDEBUG}" \
    -DWITH_ENVMOD=OFF -DWITH_STORYBOARD=OFF -DWITH_TRANSFUSION=OFF -DWITH_TESTBED=OFF -DWITH_SCENARIOS=OFF \
    -DCMAKE_PROJECT_Artery_INCLUDE="$module/inject.cmake"
cmake --build "$artery/build" --target advpipe --parallel "$jobs"

program=$artery/build/advpipe-artery
if [ -n "$into" ]; then
    mkdir -p "$into" && cp "$program" "$into/" && program=$(cd "$into" && pwd)/advpipe-artery
fi
echo "built $program; name it in the scenario (artery.program), or: export ADVPIPE_ARTERY_BIN=$program"
