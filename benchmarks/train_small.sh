#!/usr/bin/env bash
# Makes the drives that the `small` checkpoint learns from, and trains it from nothing in two rounds. On two
# quiet cores some 9 minutes of simulation and two and a half hours of training; 25 GB below build/small.
# Stopped, it goes on where it was. Nothing learns from the drive `valid`, which is scored on the way, nor from
# Town06, on which the checkpoint is judged. `family=pointpillars` or `family=centerpoint` trains that one instead.
set -euo pipefail
cd "$(dirname "$0")/.."
bin=.venv/bin
work=build/small
family=${family:-second}
mkdir -p "$work"

drives=()
drive() { # name, seed, further settings
    local settings=(--set "simulation.seed=$2")
    for setting in "${@:3}"; do settings+=(--set "$setting"); done
    [ -d "$work/$1" ] || "$bin/advpipe" simulate training --out "$work/$1" "${settings[@]}"
    drives+=("$work/$1")
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

generated bikes1 130 random 5 170 1 "$vehicles=200" "$people=200" "$parked=20" "traffic.mix=$mix_bikes1"
generated bikes2 129 spider 6 160 2 "$vehicles=260" "$people=200" "$parked=20" "traffic.mix=$mix_bikes1"
shipped boulevard 106 boulevard
shipped boulevard2 118 boulevard "$vehicles=120" "$people=250" "$parked=25"
generated grid1 101 grid 5 140 1
generated grid1b 108 grid 5 160 1 "$people=300" environment.clutter_per_km=30 "$parked=20"
generated grid2bikes 114 grid 4 180 2 "$vehicles=220" "$people=220" "traffic.mix=$mix_grid2bikes"
generated grid2bikes2 121 grid 4 240 2 "$vehicles=260" "$people=120" "$parked=15" \
    "traffic.mix=$mix_grid2bikes2"
generated grid3 102 grid 4 220 3 "$vehicles=260"
generated grid3fog 109 grid 4 200 3 "$vehicles=280" "$trees=60" "$weather.kind=fog" \
    "$weather.visibility_m=150"
shipped highway 112 highway "$vehicles=300" "$people=0" "$parked=0" "traffic.mix=$mix_highway"
shipped highway2 117 highway "$vehicles=200" "$people=0" "$parked=10"
generated open3 119 grid 3 400 3 "$speed=20" "$vehicles=200" "$people=300" "$parked=0" "$buildings=0.1"
generated open4 116 spider 5 200 4 "$speed=20" "$vehicles=240" "$people=200" "$parked=5" \
    "$buildings=0.05" "$trees=10" environment.barriers=0.6
generated open4b 124 grid 2 500 4 "$speed=20" "$vehicles=200" "$people=200" "$parked=0" \
    "$buildings=0.05" environment.barriers=0.5
generated rand1 120 random 7 130 1 "$vehicles=150" "$people=250"
generated rand2 105 random 6 150 2 "$vehicles=240"
generated rand3snow 111 random 5 200 3 "$vehicles=260" "$people=250" "$weather.kind=snow" \
    "$weather.rate_mm_per_h=1"
generated rand3trucks 122 random 5 220 3 "$vehicles=280" "$people=150" "$parked=10" "$buildings=0.3" \
    "traffic.mix=$mix_rand3trucks"
generated rand4 115 random 4 260 4 "$vehicles=220" "$parked=20" "$buildings=0.4"
generated rand4b 128 random 4 350 4 "$speed=20" "$vehicles=320" "$people=200" "$parked=0" \
    "$buildings=0.15"
generated spider2 103 spider 7 110 2 "$vehicles=220"
generated spider3 110 spider 6 140 3 "$vehicles=260" "$people=250"
generated spider3b 125 spider 5 180 3 "$vehicles=260" "$people=200" "$parked=15" \
    "traffic.mix=$mix_spider3b"
generated wide3c 127 grid 3 350 3 "$speed=22" "$vehicles=320" "$people=150" "$parked=5" "$buildings=0.2" \
    "traffic.mix=$mix_wide3c"
generated wide4 104 grid 3 300 4 "$speed=16" "$vehicles=240"
generated wide4b 123 grid 3 250 4 "$speed=16" "$vehicles=280" "$people=200" "$parked=5" "$buildings=0.1" \
    "$trees=15" "traffic.mix=$mix_wide4b"
generated wide4c 126 grid 3 450 4 "$speed=25" "$vehicles=350" "$people=150" "$parked=0" "$buildings=0.1"
generated wide4rain 107 grid 3 350 4 "$vehicles=200" "$buildings=0.2" "$parked=15" "$people=250" \
    "$weather.kind=rain" "$weather.rate_mm_per_h=15"
generated wide4semi 131 grid 3 320 4 "$speed=20" "$vehicles=260" "$people=100" "$parked=0" \
    "$buildings=0.2" "traffic.mix=$mix_wide4semi"
generated wide4trucks 113 grid 3 280 4 "$vehicles=220" "$people=120" "$parked=10" "$buildings=0.3" \
    "traffic.mix=$mix_wide4trucks"

first_round=("${drives[@]}")

# Two-wheelers, of which those above have too few.
generated bikes3 132 grid 4 190 2 "$vehicles=240" "$people=150" "$parked=15" "traffic.mix=$mix_bikes3"
generated bikes4 133 random 6 150 1 "$vehicles=200" "$people=150" "$parked=20" "traffic.mix=$mix_bikes3"
generated bikes5 134 spider 5 180 3 "$vehicles=280" "$people=150" "$parked=5" "$buildings=0.2" \
    "traffic.mix=$mix_bikes5"
generated bikes6 135 grid 3 300 4 "$vehicles=300" "$people=100" "$parked=0" "$buildings=0.1" \
    "traffic.mix=$mix_bikes6"
generated bikes7 136 random 5 200 3 "$vehicles=280" "$people=150" "$parked=5" "traffic.mix=$mix_bikes7"
generated bikes8 137 spider 7 120 1 "$vehicles=200" "$people=200" "$parked=20" "traffic.mix=$mix_bikes3"
second_round=("${drives[@]}")

generated valid 901 random 5 190 2 "$vehicles=220" "$people=250" "$parked=20" simulation.duration_s=150

train() { # name, seed, steps, further options and drives
    [ -f "$work/$1/detector.safetensors" ] || "$bin/advpipe" train --out "$work/$1" --seed "$2" --steps "$3" \
        --family "$family" --bf16 --validate "$work/valid" "${@:4}"
}
case $family in
second)
    train run1 0 7500 "${first_round[@]}"
    train run2 1 4000 --start "$work/run1/detector.safetensors" --learning-rate 0.002 "${second_round[@]}"
    echo "checkpoint: $work/run2/detector.safetensors"
    ;;
pointpillars) # two hours
    train pointpillars 0 9000 "${second_round[@]}"
    ;;
centerpoint) # two hours
    train centerpoint 0 7000 "${second_round[@]}"
    ;;
*)
    echo "no family $family; known: second, pointpillars, centerpoint" >&2
    exit 2
    ;;
esac
