#!/usr/bin/env bash
# One case of the end-to-end tests of RenderMan's command lines.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

# No temporary scene is left.
leavesNoScratch() {
  local left
  left=$(find . -name 'surfeit-ptfilter-*')
  [[ -z $left ]] || fail "left behind: $left"
}

# The same bytes as the commands that it stands for.
ptfilterIsIndexAndGather() {
  generate a.ptc --surfels 1500
  generate b.ptc --surfels 1500 --seed 2
  run 0 index a.ptc -o a.sft --quiet
  run 0 ptfilter -filter occlusion -maxsolidangle 0.2 -maxdist 300 -coneangle 1.4 -falloff 1 \
    -falloffmode 1 -distribution uniform -hitsides front -rasterresolution 12 a.ptc ao.ptc
  run 0 gather a.sft a.ptc -o long_ao.ptc --max-solid-angle 0.2 --max-dist 300 --cone-angle 1.4 \
    --falloff 1 --falloff-mode polynomial --distribution uniform --raster-resolution 12
  sameBytes ao.ptc long_ao.ptc

  # Sides are both by default; two dashes and -o do too
  run 0 ptfilter --filter colorbleeding --maxvariation 0.05 a.ptc -o bleeding.ptc --stats stats.json
  run 0 gather a.sft a.ptc -o long_bleeding.ptc --mode bleeding --sides both --max-variation 0.05
  sameBytes bleeding.ptc long_bleeding.ptc
  jsonHas stats.json command filter receivers

  # Several clouds, and several bounces
  run 0 ptfilter -filter colorbleeding -bounces 3 -microbufres 8 a.ptc b.ptc two.ptc
  run 0 convert a.ptc b.ptc -o both.ply --quiet
  run 0 index a.ptc b.ptc -o both.sft --quiet
  run 0 bounce both.sft --bounces 2 --sides both --raster-resolution 8 -o bounced.sft --quiet
  run 0 gather bounced.sft both.ply -o long_two.ptc --mode bleeding --sides both \
    --raster-resolution 8 --quiet
  sameBytes two.ptc long_two.ptc
  leavesNoScratch
}

ptfilterReadsPhotonMaps() {
  makeScene 100
  run 0 sample cornell.obj -o photons.ply --photons 3000 --quiet
  run 0 ptfilter -photonmap -nphotons 50 photons.ply rad.ptc
  run 0 radiance photons.ply -o long_rad.ptc --nphotons 50 --quiet
  sameBytes rad.ptc long_rad.ptc
  run 0 ptfilter -filter photonmap -nphotons 50 photons.ply again.ptc
  sameBytes rad.ptc again.ptc
}

# Every word that changes nothing is told; one that asks for something else is a note.
wordsWithoutMeaningAreTold() {
  generate a.ptc --surfels 500
  run 0 ptfilter -filter colorbleeding -clamp 1 -sortbleeding 1 -samplebase 0 -progress 1 --strict \
    -hitsides front a.ptc o.ptc
  says "-clamp 1: no pixel counts more than once" "-sortbleeding 1: contributions are always sorted" \
    "-samplebase 0: receivers are not jittered"
  run 0 ptfilter -filter colorbleeding -hitsides front --quiet a.ptc plain.ptc
  sameBytes o.ptc plain.ptc
  local word
  for word in "clamp 0" "sortbleeding 0" "samplebase 1" "bias 0.1" "samples 64" "seed -1" \
    "maxerror 0.5" "maxpixeldist 5" "hitmode shader"; do
    run 0 ptfilter -filter occlusion -${word% *} "${word#* }" a.ptc o.ptc
    says "-$word: " ": the word is ignored"
  done
  run 3 ptfilter -filter occlusion -bias 0.1 --strict a.ptc refused.ptc
  leavesNothing refused
  run 0 ptfilter -filter occlusion -rasterresolution 11 a.ptc o.ptc
  says "-rasterresolution 11: 12 is taken"
  leavesNoScratch
}

wrongCommandLinesAreRefused() {
  generate a.ptc --surfels 500
  run 2 ptfilter a.ptc o.ptc
  says "-filter: expected occlusion, colorbleeding or photonmap"
  run 2 ptfilter -filter ssdiffusion a.ptc o.ptc
  says "occlusion,colorbleeding,photonmap"
  run 2 ptfilter -filter occlusion -bounces 2 a.ptc o.ptc
  run 2 ptfilter -photonmap -filter occlusion a.ptc o.ptc
  run 2 ptfilter -filter occlusion -maxsolidangl 1 a.ptc o.ptc
  says "did you mean --maxsolidangle?"
  run 2 ptfilter -filter occlusion a.ptc a.ptc
  says "would replace its input"
  run 2 ptfilter -filter occlusion a.ptc
  run 33 ptfilter -filter occlusion --memory 20M a.ptc o.ptc
  run 74 ptfilter -filter occlusion nosuch.ptc o.ptc
  leavesNothing o.ptc
  leavesNoScratch
}

brickmakeIsBrick() {
  generate a.ptc --surfels 1500
  run 0 brickmake -maxerror 0.02 a.ptc a.vdb
  run 0 brick --max-error 0.02 a.ptc -o long.vdb
  sameBytes a.vdb long.vdb
  run 0 brickmake -maxdepth 4 -radiusscale 2 a.ptc a.vdb
  says "-maxdepth 4: " "-radiusscale 2: points count by their areas: the word is ignored"
  run 2 brickmake a.ptc a.bkm
  says "brick maps are OpenVDB files"
}

runCase
