#!/usr/bin/env bash
# Makes the drives that the `small` checkpoint learns from, and trains it from nothing: some 40 minutes of
# simulation on two quiet cores, 8 GB below build/small, and several runs of under two hours each, or with
# `device=cuda` one of some ten minutes. Stopped, it goes on where it was. Nothing learns from the drives `valid`
# and `valid_hdl64`, which are scored on the way, nor from Town06, on which the checkpoint is judged.
# `family=pointpillars` or `family=centerpoint` trains that one instead, `preset=360` a larger one; `runs=1` stops
# after the first run. `start=FILE` begins with a checkpoint, such as SECOND's for CenterPoint, in one short run.
set -euo pipefail
cd "$(dirname "$0")/.."
bin=.venv/bin
work=build/small
family=${family:-second}
preset=${preset:-small}
device=${device:-cpu}
mkdir -p "$work"

# The world before streets had sides and cars the sizes of a fleet, in which some drives are made again: a detector
# is to find what is in a drive that was recorded with it.
before=$work/before
if [ ! -d "$before" ]; then
    mkdir -p "$before.new/advpipe/sample"
    git archive 576675c1 api pipeline stages scenarios | tar x -C "$before.new"
    mv "$before.new"/{pipeline,stages,scenarios,api/*} "$before.new/advpipe"
    mv "$before.new" "$before"
fi
of_before="bikes1 bikes4 bikes5 bikes7 bikes8 boulevard2 grid1b grid2bikes2 grid3 highway2 open3 rand1 rand2 rand4b \
spider3 wide4b wide4semi wide4trucks"

drives=()
record() { # name, seed, further settings
    local settings=(--set "simulation.seed=$2" --set simulation.duration_s=60)
    for setting in "${@:3}"; do settings+=(--set "$setting"); done
    [ -d "$work/$1" ] || "$bin/python" -m advpipe simulate training --out "$work/$1" "${settings[@]}"
    drives+=("$work/$1")
}
drive() { # name, seed, further settings, of which the last one is the LiDAR: twice, and in the world before
    record "$@"
    record "$1-again" "$(($2 + 200))" "${@:3}"
    if [[ " $of_before " == *" $1 "* ]]; then
        PYTHONPATH=$before record "$1-before" "$2" "${@:3:$#-3}"
    fi
}
generated() { # name, seed, kind, size, block, lanes, further settings
    drive "$1" "$2" map.sumo_net=null "map.generator.kind=$3" "map.generator.size=$4" \
        "map.generator.block_m=$5" "map.generator.lanes=$6" "${@:7}"
}
shipped() { # name, seed, network, further settings
    drive "$1" "$2" "map.sumo_net=$PWD/scenarios/networks/$3.net.xml" "${@:4}"
}
vehicles=traffic.vehicles people=traffic.pedestrians parked=traffic.parked_per_km
buildings=environment.buildings trees=environment.trees_per_km speed=map.generator.speed_mps
weather=environment.weather

# LiDARs that turn once a second, as the scenario `training` has one cloud a second; a drive adds the height.
lidar="sensors.lidars.lidar={rotation_frequency: 1"
even64="$lidar, points_per_second: 115200"
hdl64="$lidar, preset: hdl-64e, points_per_second: 133331"
pandar64="$lidar, preset: pandar64, points_per_second: 115200"
hdl32="$lidar, preset: hdl-32e, points_per_second: 69444"
vlp32="$lidar, preset: vlp-32c, points_per_second: 57870"
os128="$lidar, preset: os1-128, points_per_second: 131031"
pandar128="$lidar, preset: pandar128, points_per_second: 230400"

mix_bikes1="{sedan: 0.2, hatchback: 0.14, suv: 0.12, pickup: 0.04, van: 0.06, minibus: 0.03, box_truck: 0.04, semi_trailer: 0.02, bus: 0.04, motorcycle: 0.07, scooter: 0.06, bicycle: 0.18}"
mix_bikes3="{sedan: 0.16, hatchback: 0.12, suv: 0.1, pickup: 0.04, van: 0.06, minibus: 0.03, box_truck: 0.04, semi_trailer: 0.02, bus: 0.03, motorcycle: 0.1, scooter: 0.1, bicycle: 0.2}"
mix_bikes5="{sedan: 0.2, hatchback: 0.12, suv: 0.12, pickup: 0.04, van: 0.08, minibus: 0.03, box_truck: 0.06, semi_trailer: 0.04, bus: 0.04, motorcycle: 0.12, scooter: 0.05, bicycle: 0.1}"
mix_bikes6="{sedan: 0.2, hatchback: 0.12, suv: 0.12, pickup: 0.04, van: 0.08, minibus: 0.03, box_truck: 0.06, semi_trailer: 0.06, bus: 0.04, motorcycle: 0.1, scooter: 0.05, bicycle: 0.1}"
mix_bikes7="{sedan: 0.18, hatchback: 0.12, suv: 0.1, pickup: 0.04, van: 0.07, minibus: 0.03, box_truck: 0.05, semi_trailer: 0.03, bus: 0.04, motorcycle: 0.1, scooter: 0.08, bicycle: 0.16}"
mix_grid2bikes="{sedan: 0.2, hatchback: 0.16, suv: 0.12, pickup: 0.05, van: 0.08, box_truck: 0.05, bus: 0.04, motorcycle: 0.1, bicycle: 0.2}"
mix_grid2bikes2="{sedan: 0.2, hatchback: 0.14, suv: 0.12, pickup: 0.05, van: 0.1, box_truck: 0.07, semi_trailer: 0.02, bus: 0.05, motorcycle: 0.1, bicycle: 0.15}"
mix_highway="{sedan: 0.28, hatchback: 0.16, suv: 0.2, pickup: 0.05, van: 0.1, box_truck: 0.08, semi_trailer: 0.07, bus: 0.04, motorcycle: 0.02}"
mix_rand3trucks="{sedan: 0.2, hatchback: 0.14, suv: 0.13, pickup: 0.06, van: 0.14, box_truck: 0.11, semi_trailer: 0.05, bus: 0.08, motorcycle: 0.04, bicycle: 0.05}"
mix_spider3b="{sedan: 0.2, hatchback: 0.15, suv: 0.15, pickup: 0.06, van: 0.12, box_truck: 0.09, semi_trailer: 0.03, bus: 0.08, motorcycle: 0.05, bicycle: 0.07}"
mix_wide3c="{sedan: 0.22, hatchback: 0.15, suv: 0.15, pickup: 0.06, van: 0.1, minibus: 0.04, box_truck: 0.08, semi_trailer: 0.08, bus: 0.05, motorcycle: 0.03, bicycle: 0.04}"
mix_wide4b="{sedan: 0.2, hatchback: 0.15, suv: 0.16, pickup: 0.05, van: 0.12, box_truck: 0.08, semi_trailer: 0.02, bus: 0.07, motorcycle: 0.06, bicycle: 0.09}"
mix_wide4semi="{sedan: 0.2, hatchback: 0.12, suv: 0.13, pickup: 0.07, van: 0.1, minibus: 0.04, box_truck: 0.1, semi_trailer: 0.12, bus: 0.08, motorcycle: 0.02, bicycle: 0.02}"
mix_wide4trucks="{sedan: 0.2, hatchback: 0.14, suv: 0.14, pickup: 0.08, van: 0.12, box_truck: 0.1, semi_trailer: 0.05, bus: 0.08, motorcycle: 0.04, bicycle: 0.05}"

generated bikes1 130 random 5 170 1 "$vehicles=200" "$people=200" "$parked=20" "traffic.mix=$mix_bikes1" \
    "$even64, z_m: 1.8}"
generated bikes2 129 spider 6 160 2 "$vehicles=260" "$people=200" "$parked=20" "traffic.mix=$mix_bikes1" \
    "$hdl64, z_m: 2.0}"
shipped boulevard 106 boulevard "$even64, z_m: 1.85}"
shipped boulevard2 118 boulevard "$vehicles=120" "$people=250" "$parked=25" "$pandar64, z_m: 1.75}"
generated grid1 101 grid 5 140 1 "$even64, z_m: 1.6}"
generated grid1b 108 grid 5 160 1 "$people=300" environment.clutter_per_km=30 "$parked=20" \
    "$hdl64, z_m: 1.65}"
generated grid2bikes 114 grid 4 180 2 "$vehicles=220" "$people=220" "traffic.mix=$mix_grid2bikes" \
    "$hdl32, z_m: 1.95}"
generated grid2bikes2 121 grid 4 240 2 "$vehicles=260" "$people=120" "$parked=15" \
    "traffic.mix=$mix_grid2bikes2" "$even64, z_m: 1.73}"
generated grid3 102 grid 4 220 3 "$vehicles=260" "$hdl64, z_m: 1.9}"
generated grid3fog 109 grid 4 200 3 "$vehicles=280" "$trees=60" "$weather.kind=fog" \
    "$weather.visibility_m=150" "$pandar128, z_m: 1.5}"
shipped highway 112 highway "$vehicles=300" "$people=0" "$parked=0" "traffic.mix=$mix_highway" \
    "$even64, z_m: 1.8}"
shipped highway2 117 highway "$vehicles=200" "$people=0" "$parked=10" "$hdl64, z_m: 2.0}"
generated open3 119 grid 3 400 3 "$speed=20" "$vehicles=200" "$people=300" "$parked=0" "$buildings=0.1" \
    "$even64, z_m: 1.85}"
generated open4 116 spider 5 200 4 "$speed=20" "$vehicles=240" "$people=200" "$parked=5" "$buildings=0.05" \
    "$trees=10" environment.barriers=0.6 "$pandar64, z_m: 1.75}"
generated open4b 124 grid 2 500 4 "$speed=20" "$vehicles=200" "$people=200" "$parked=0" "$buildings=0.05" \
    environment.barriers=0.5 "$even64, z_m: 1.6}"
generated rand1 120 random 7 130 1 "$vehicles=150" "$people=250" "$hdl64, z_m: 1.65}"
generated rand2 105 random 6 150 2 "$vehicles=240" "$vlp32, z_m: 1.95}"
generated rand3snow 111 random 5 200 3 "$vehicles=260" "$people=250" "$weather.kind=snow" \
    "$weather.rate_mm_per_h=1" "$even64, z_m: 1.73}"
generated rand3trucks 122 random 5 220 3 "$vehicles=280" "$people=150" "$parked=10" "$buildings=0.3" \
    "traffic.mix=$mix_rand3trucks" "$hdl64, z_m: 1.9}"
generated rand4 115 random 4 260 4 "$vehicles=220" "$parked=20" "$buildings=0.4" "$os128, z_m: 1.5}"
generated rand4b 128 random 4 350 4 "$speed=20" "$vehicles=320" "$people=200" "$parked=0" \
    "$buildings=0.15" "$even64, z_m: 1.8}"
generated spider2 103 spider 7 110 2 "$vehicles=220" "$hdl64, z_m: 2.0}"
generated spider3 110 spider 6 140 3 "$vehicles=260" "$people=250" "$even64, z_m: 1.85}"
generated spider3b 125 spider 5 180 3 "$vehicles=260" "$people=200" "$parked=15" \
    "traffic.mix=$mix_spider3b" "$pandar64, z_m: 1.75}"
generated wide3c 127 grid 3 350 3 "$speed=22" "$vehicles=320" "$people=150" "$parked=5" "$buildings=0.2" \
    "traffic.mix=$mix_wide3c" "$even64, z_m: 1.6}"
generated wide4 104 grid 3 300 4 "$speed=16" "$vehicles=240" "$hdl64, z_m: 1.65}"
generated wide4b 123 grid 3 250 4 "$speed=16" "$vehicles=280" "$people=200" "$parked=5" "$buildings=0.1" \
    "$trees=15" "traffic.mix=$mix_wide4b" "$hdl32, z_m: 1.95}"
generated wide4c 126 grid 3 450 4 "$speed=25" "$vehicles=350" "$people=150" "$parked=0" "$buildings=0.1" \
    "$even64, z_m: 1.73}"
generated wide4rain 107 grid 3 350 4 "$vehicles=200" "$buildings=0.2" "$parked=15" "$people=250" \
    "$weather.kind=rain" "$weather.rate_mm_per_h=15" "$hdl64, z_m: 1.9}"
generated wide4semi 131 grid 3 320 4 "$speed=20" "$vehicles=260" "$people=100" "$parked=0" \
    "$buildings=0.2" "traffic.mix=$mix_wide4semi" "$pandar128, z_m: 1.5}"
generated wide4trucks 113 grid 3 280 4 "$vehicles=220" "$people=120" "$parked=10" "$buildings=0.3" \
    "traffic.mix=$mix_wide4trucks" "$even64, z_m: 1.8}"

# Two-wheelers, of which those above have too few.
generated bikes3 132 grid 4 190 2 "$vehicles=240" "$people=150" "$parked=15" "traffic.mix=$mix_bikes3" \
    "$hdl64, z_m: 2.0}"
generated bikes4 133 random 6 150 1 "$vehicles=200" "$people=150" "$parked=20" "traffic.mix=$mix_bikes3" \
    "$even64, z_m: 1.85}"
generated bikes5 134 spider 5 180 3 "$vehicles=280" "$people=150" "$parked=5" "$buildings=0.2" \
    "traffic.mix=$mix_bikes5" "$pandar64, z_m: 1.75}"
generated bikes6 135 grid 3 300 4 "$vehicles=300" "$people=100" "$parked=0" "$buildings=0.1" \
    "traffic.mix=$mix_bikes6" "$even64, z_m: 1.6}"
generated bikes7 136 random 5 200 3 "$vehicles=280" "$people=150" "$parked=5" "traffic.mix=$mix_bikes7" \
    "$hdl64, z_m: 1.65}"
generated bikes8 137 spider 7 120 1 "$vehicles=200" "$people=200" "$parked=20" "traffic.mix=$mix_bikes3" \
    "$vlp32, z_m: 1.95}"
trained_on=("${drives[@]}")

drive() { record "$@"; }
generated valid 901 random 5 190 2 "$vehicles=220" "$people=250" "$parked=20" "$even64, z_m: 1.8}"
generated valid_hdl64 902 spider 6 150 1 "$vehicles=200" "$people=250" "$hdl64, z_m: 1.73}"

train() { # name, seed, steps, further options
    [ -f "$work/$1/detector.safetensors" ] || "$bin/advpipe" train --out "$work/$1" --seed "$2" --steps "$3" \
        --family "$family" --preset "$preset" --device "$device" --validate "$work/valid" "${@:4}" "${trained_on[@]}"
}
name=$family-$preset
last=
if [ "$device" != cpu ]; then
    train "$name" 0 "${steps:-6000}" --batch-size 16
    last=$name
elif [ -n "${start:-}" ]; then # under an hour on two quiet cores
    train "$name" 0 "${steps:-1250}" --batch-size 4 --bf16 --start "$start" --learning-rate 0.002
    last=$name
else # each run under two hours on two quiet cores
    rates=(0.003 0.002 0.0015)
    for ((run = 1; run <= ${runs:-3}; run++)); do
        train "$name-$run" "$((run - 1))" "${steps:-6000}" --bf16 --learning-rate "${rates[run - 1]}" ${last:+--start "$work/$last/detector.safetensors"}
        last=$name-$run
    done
fi
echo "checkpoint: $work/$last/detector.safetensors"
