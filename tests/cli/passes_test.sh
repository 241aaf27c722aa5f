#!/usr/bin/env bash
# One case of the end-to-end tests of render passes and of clouds in other formats than PLY.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

# Passes from a camera, light gathered at their pixels, pictures of both.
twoPassesMakeAPicture() {
  makeScene 20000
  run 0 view cornell.sft --passes passes.exr --eye "0.5 0.5 2.4" --look-at "0.5 0.5 0" --fov 60 \
    --size 96x96 --stats view.json
  jsonHas view.json pass_pixels passes
  run 0 info passes.exr
  says OpenEXR pixel_x
  run 0 gather cornell.sft passes.exr -o light.exr --mode bleeding
  run 0 info light.exr
  says irradiance_r occlusion
  for channel in radiosity indirect lit ao; do
    run 0 composite passes.exr light.exr -o $channel.png --channel $channel --stats $channel.json
    jsonHas $channel.json pixels width
    exists $channel.png
  done
  differentBytes radiosity.png lit.png
  run 0 composite passes.exr light.exr -o shown.png --channel lit --exposure 1
  differentBytes shown.png lit.png
  run 0 composite passes.exr light.exr -o shown.png --channel lit --background "1 1 1"
  differentBytes shown.png lit.png
  run 0 composite passes.exr light.exr -o shown.png --channel ao --range "0.5 1"
  differentBytes shown.png ao.png
  run 0 composite passes.exr light.exr -o shown.png --channel lit --reduce 2 --stats shown.json
  jsonIs shown.json width 48 height 48
  run 0 convert light.exr -o light.ply
  run 0 convert light.ply -o back.exr --like passes.exr
  run 0 composite passes.exr back.exr -o shown.png --channel lit
  sameBytes shown.png lit.png
  run 0 gather cornell.sft passes.exr -o again.exr --mode bleeding --threads 1 --memory 64M
  sameBytes light.exr again.exr
  run 2 gather cornell.sft passes.exr -o light.jpg
  says .exr .ply
  leavesNothing light.jpg
  run 0 composite passes.exr light.exr -o lit.exr --channel lit
  run 3 gather cornell.sft lit.exr -o none.exr
  says lit.exr position
  leavesNothing none.exr
}

# A production file in, the same format out.
cloudsOfOtherFormatsWork() {
  makeScene 5000
  run 0 gather cornell.sft cornell.ply -o baked.ptc --mode bleeding
  run 0 info baked.ptc
  says PTC occlusion irradiance_r 5,000
  run 0 index baked.ptc -o baked.sft
  run 0 verify baked.sft
  run 0 gather cornell.sft baked.ptc -o baked.bgeo.gz --mode bleeding
  run 0 info baked.bgeo.gz
  says BGEO irradiance_r
  run 0 view baked.bgeo.gz -o ao.png --channel ao
  exists ao.png
  head -c 3000 baked.ptc > cut.ptc
  run 3 index cut.ptc -o cut.sft
  says cut.ptc
  leavesNothing cut.sft
}

runCase
