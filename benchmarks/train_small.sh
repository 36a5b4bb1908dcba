#!/usr/bin/env bash
# Makes the drives that the shipped `small` checkpoint learned from, and trains it from nothing, in two
# rounds of the learning rate. Some 10 minutes of simulation and 45 of training on two cores; 9 GB below
# build/small.
set -euo pipefail
cd "$(dirname "$0")/.."
bin=.venv/bin
work=build/small
mkdir -p "$work"

generate() { "$bin/netgenerate" "${@:2}" --output-file "$work/$1.net.xml" --no-warnings; }
generate grid1 --grid --grid.number 5 --grid.length 140 --default.lanenumber 1 --default.speed 13.9 --seed 1
generate grid3 --grid --grid.number 4 --grid.length 220 --default.lanenumber 3 --default.speed 16
generate wide5 --grid --grid.x-number 4 --grid.y-number 2 --grid.x-length 300 --grid.y-length 160 \
    --default.lanenumber 5 --default.speed 16
generate spider2 --spider --spider.arm-number 7 --spider.circle-number 3 --spider.space-radius 110 \
    --default.lanenumber 2
generate rand2 --rand --rand.iterations 60 --rand.min-distance 90 --rand.max-distance 220 \
    --default.lanenumber 2 --seed 3
generate wide4 --grid --grid.x-number 3 --grid.y-number 2 --grid.x-length 400 --grid.y-length 250 \
    --default.lanenumber 4 --default.speed 14
generate rand3 --rand --rand.iterations 50 --rand.min-distance 120 --rand.max-distance 300 \
    --default.lanenumber 3 --seed 9
cp scenarios/networks/boulevard.net.xml "$work/"

drives=()
drive() { # name, seed, network, further settings
    local settings=(--set "simulation.seed=$2" --set "map.sumo_net=$work/$3.net.xml")
    for setting in "${@:4}"; do settings+=(--set "$setting"); done
    "$bin/advpipe" simulate training --out "$work/$1" --overwrite "${settings[@]}"
    drives+=("$work/$1")
}
drive grid1 101 grid1
drive grid3 102 grid3 traffic.vehicles=260
drive spider2 103 spider2 traffic.vehicles=220
drive wide5 104 wide5 traffic.vehicles=260
drive rand2 105 rand2 traffic.vehicles=300
drive boulevard 106 boulevard
drive wide5b 107 wide5 traffic.vehicles=180 environment.buildings=0.2 traffic.parked_per_km=15 \
    traffic.pedestrians=250
drive grid1b 108 grid1 traffic.pedestrians=300 environment.clutter_per_km=30 traffic.parked_per_km=20
drive grid3b 109 grid3 traffic.vehicles=320 environment.trees_per_km=60
drive spider2b 110 spider2 traffic.vehicles=260 traffic.pedestrians=250

"$bin/advpipe" train "${drives[@]}" --out "$work/first" --steps 2400 --seed 0 --bf16

drive wide4 201 wide4 traffic.vehicles=260 traffic.parked_per_km=20
drive rand3 202 rand3 traffic.vehicles=400 traffic.pedestrians=300
drive wide4b 203 wide4 traffic.vehicles=330 traffic.parked_per_km=15 environment.buildings=0.4
drive grid3c 204 grid3 traffic.vehicles=300 traffic.parked_per_km=20
drive boulevardb 205 boulevard traffic.vehicles=170 traffic.parked_per_km=25

"$bin/advpipe" train "${drives[@]}" --out "$work/second" --start "$work/first/detector.safetensors" \
    --steps 2600 --learning-rate 0.002 --seed 1 --bf16
echo "checkpoint: $work/second/detector.safetensors"
