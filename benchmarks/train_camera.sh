#!/usr/bin/env bash
# Records the pictures that an image detector learns from and is judged on, and trains it from nothing: some 20
# minutes of one quiet core for the drives, 1 GB below build/camera, and an hour of one core for the training.
# Stopped, it goes on where it was. All drives that it learns from are on generated maps; `test_...` are on maps
# that it never sees: those of the scenarios `district`, `boulevard` and `highway`, and a generated one.
# jobs=2 records two drives at once; record_only=1 does not train. The shipped checkpoint `small` learned from
# the first eight drives only, see pipeline/image_detector/MODEL_CARD.md.
set -euo pipefail
cd "$(dirname "$0")/.."
bin=.venv/bin
work=${work:-build/camera}
mkdir -p "$work"

# Cameras to all sides, of several heights, angles and fields of view, every other second.
rig() { # front fov, side fov, height, pitch
    echo "sensors.cameras={front: {preset: front, fov: $1, z_m: $3, pitch_deg: $4, $shared}," \
        "rear: {preset: front, fov: $2, z_m: $3, x_m: -1, yaw_deg: 180, $shared}," \
        "left: {preset: front, fov: $2, z_m: $3, yaw_deg: 50, $shared}," \
        "right: {preset: front, fov: $2, z_m: $3, yaw_deg: -50, $shared}}"
}
shared="sensor_tick: 2.0, exposure_speed: 1.0"
low=$(rig 70 90 1.35 0) middle=$(rig 60 75 1.5 2) high=$(rig 80 70 1.75 4) tele=$(rig 45 60 1.6 1)

drives=()
drive() { # name, scenario, seed, cameras, start, further settings
    local settings=(--set "simulation.seed=$3" --set "$4" --set "simulation.start=$5"
        --set "sensors.lidars={}" --set simulation.step_s=1.0 --set simulation.warmup_s=20
        --set recording.markers=false --set v2x.enabled=false)
    for setting in "${@:6}"; do settings+=(--set "$setting"); done
    drives+=("$work/$1")
    [ -d "$work/$1" ] && return
    while [ "$(jobs -pr | wc -l)" -ge "${jobs:-1}" ]; do wait -n; done
    "$bin/advpipe" simulate "$2" --out "$work/$1" "${settings[@]}" &
}
generated() { # name, seed, cameras, start, kind, size, block, lanes, further settings
    drive "$1" training "$2" "$3" "$4" map.sumo_net=null "map.generator.kind=$5" "map.generator.size=$6" \
        "map.generator.block_m=$7" "map.generator.lanes=$8" simulation.duration_s=40 "${@:9}"
}
test_drive() { # name, scenario, seed, start, further settings
    drive "$1" "$2" "$3" "$middle" "$4" simulation.duration_s=24 traffic.vehicles=160 "${@:5}"
}
vehicles=traffic.vehicles people=traffic.pedestrians parked=traffic.parked_per_km
buildings=environment.buildings speed=map.generator.speed_mps weather=environment.weather
rain() { echo "$weather={kind: rain, rate_mm_per_h: $1}"; }
snow() { echo "$weather={kind: snow, rate_mm_per_h: $1}"; }
fog() { echo "$weather={kind: fog, visibility_m: $1}"; }
bikes="traffic.mix={car: 0.4, van: 0.06, minibus: 0.03, box_truck: 0.05, bus: 0.04, motorcycle: 0.1, scooter: 0.08, bicycle: 0.24}"
trucks="traffic.mix={car: 0.5, van: 0.12, minibus: 0.04, box_truck: 0.1, tipper: 0.05, semi_trailer: 0.07, bus: 0.07, motorcycle: 0.02, bicycle: 0.03}"

generated noon1 301 "$middle" 2026-06-21T10:00:00Z random 5 170 1 "$vehicles=200" "$people=300" "$parked=20" "$bikes"
generated night1 302 "$middle" 2026-06-21T22:00:00Z spider 6 150 2 "$vehicles=240" "$people=300" "$trucks"
generated rain1 303 "$low" 2026-06-21T13:00:00Z grid 5 150 1 "$people=350" "$bikes" "$(rain 8)"
generated morning1 304 "$high" 2026-06-21T04:45:00Z grid 4 200 2 "$vehicles=240" "$people=250" "$trucks"
generated winter1 305 "$middle" 2026-12-21T11:00:00Z random 6 150 2 "$vehicles=240" "$people=300" "$bikes"
generated evening1 306 "$low" 2026-06-21T18:20:00Z random 5 200 3 "$vehicles=260" "$people=250" "$parked=15"
generated wide1 307 "$tele" 2026-06-21T08:00:00Z grid 3 320 4 "$speed=20" "$vehicles=280" "$people=200" "$buildings=0.2" "$trucks"
generated night2 308 "$high" 2026-12-21T18:00:00Z grid 5 140 1 "$vehicles=180" "$people=350" "$parked=25" "$bikes"
generated snow1 309 "$middle" 2026-12-21T10:00:00Z spider 6 140 1 "$vehicles=200" "$people=300" "$bikes" "$(snow 1)"
generated fog1 310 "$middle" 2026-10-10T08:00:00Z random 5 180 2 "$vehicles=220" "$people=250" "$trucks" "$(fog 200)"
generated noon2 311 "$high" 2026-04-10T11:30:00Z spider 7 120 2 "$vehicles=240" "$people=350" "$bikes"
generated night_rain1 312 "$low" 2026-06-21T21:30:00Z random 5 170 2 "$vehicles=240" "$people=300" "$bikes" "$(rain 5)"
generated noon3 313 "$tele" 2026-08-01T12:30:00Z random 6 160 1 "$vehicles=220" "$people=350" "$parked=10" "$bikes"
generated wide2 314 "$middle" 2026-06-21T15:00:00Z spider 5 200 4 "$speed=18" "$vehicles=300" "$people=250" "$buildings=0.1" "$trucks"
generated dusk1 315 "$middle" 2026-06-21T19:20:00Z grid 4 180 2 "$vehicles=240" "$people=300" "$bikes"
generated rain2 316 "$high" 2026-06-21T09:00:00Z spider 6 160 3 "$vehicles=260" "$people=300" "$trucks" "$(rain 20)"
generated night3 317 "$tele" 2026-06-21T23:00:00Z random 4 260 3 "$vehicles=260" "$people=250" "$buildings=0.4"
generated noon4 318 "$low" 2026-06-21T12:00:00Z grid 5 160 2 "$vehicles=240" "$people=400" "$parked=30" "$bikes"
generated winter2 319 "$high" 2026-12-21T14:30:00Z spider 6 150 1 "$vehicles=200" "$people=350" "$parked=20" "$bikes"
generated noon5 320 "$middle" 2026-05-05T07:00:00Z random 5 190 2 "$vehicles=240" "$people=350" "$bikes"
trained_on=("${drives[@]}")

generated valid 901 "$middle" 2026-06-21T09:30:00Z random 5 180 2 "$vehicles=240" "$people=300" "$bikes"
test_drive test_district_noon district 951 2026-06-21T10:00:00Z "$people=250" "$bikes"
test_drive test_district_night district 952 2026-06-21T22:00:00Z "$people=250" "$bikes"
test_drive test_boulevard_rain boulevard 953 2026-06-21T13:00:00Z "$people=200" "$bikes" "$(rain 10)"
test_drive test_highway_morning highway 954 2026-06-21T06:00:00Z "$trucks"
generated test_generated 955 "$high" 2026-06-21T16:30:00Z grid 4 190 2 "$vehicles=240" "$people=300" "$bikes"
wait
[ -z "${record_only:-}" ] || exit 0

[ -f "$work/run/detector.safetensors" ] || "$bin/advpipe" train-camera "${trained_on[@]}" --out "$work/run" \
    --steps "${steps:-12000}" --bf16 --validate "$work/valid"
"$bin/python" benchmarks/camera_detector.py "$work"/test_* --detector "$work/run/detector.safetensors"
