#!/usr/bin/env bash
# Makes the pictures of docs/gallery.md, in docs/gallery/, from scenes that it makes itself. Clouds
# and scenes go to out/gallery/. Minutes on two cores. Chapters may be named to make only these:
#
#   scripts/gallery.sh [direct area photons environment bounces occlusion glossy volume subset cube camera caustics translucent tints hair screen relit looked_up look brightness shiny]
#
# SURFEIT_BUILD names a build directory to take the programs from; else build/release is built.
set -euo pipefail
cd "$(dirname "$0")/.."

surfels=600000
receivers=300000
fewer=120000 # surfels that are seen as disks, where 300,000 would show no more
box_camera=(--eye "0.5 0.5 2.4" --look-at "0.5 0.5 0" --fov 37)
box_view=("${box_camera[@]}" --size 400x400)
speckled_view=("${box_camera[@]}" --size 280x280)  # of what a PNG packs badly
studio_eye="0 3.4 5.4"
studio_camera=(--eye "$studio_eye" --look-at "0 0.3 0.1" --fov 37)
studio_view=("${studio_camera[@]}" --size 560x420)
middle_view=("${studio_camera[@]}" --size 420x315)
look_view=("${studio_camera[@]}" --size 280x210)
lamps_view=(--eye "0 3.0 6.6" --look-at "0 0.75 0" --fov 35 --size 560x420)
sun=(--light-directional "0.9 -1.6 -1.0  1.25 1.2 1.1")

say() { printf '\n== %s\n' "$*"; }

# Runs a command and tells its seconds of processor time, which docs/gallery.md quotes
timed() {
  local seconds TIMEFORMAT="%U"
  seconds=$({ time "$@" --quiet; } 2>&1) || { echo "$seconds" >&2 && exit 1; }
  printf '%6.1f s  %s\n' "$seconds" "$*"
}
sample() { timed surfeit sample "$@"; }
index() { timed surfeit index "$@"; }
gather() { timed surfeit gather "$@"; }
draw() { # PICTURE CLOUD OPTIONS...
  timed surfeit view "$2" -o "$pictures/$1.png" "${@:3}"
}
clouds() { ../../scripts/gallery_clouds.py "$@"; }

if [[ -z ${SURFEIT_BUILD:-} ]]; then
  SURFEIT_BUILD=$PWD/build/release
  say "Building the program (preset release)"
  scripts/install-deps.sh
  cmake --preset release > /dev/null
  cmake --build --preset release --parallel "$(nproc)" \
    --target surfeit_program cornell_scene studio_scene
fi
SURFEIT_BUILD=$(realpath "$SURFEIT_BUILD")
PATH=$SURFEIT_BUILD/bin:$SURFEIT_BUILD/examples:$PATH
pictures=$PWD/docs/gallery
mkdir -p "$pictures" out/gallery
cd out/gallery

scenes() {
  say "Scenes: a box with two spheres, a knot, a teapot and a bumpy ball on a floor, and three lamps"
  cornell_scene .
  studio_scene .
  # The box: what lights it, and where it is looked at. With --emission the lamp itself shows
  sample cornell.obj -o box.ply --count $surfels
  index box.ply -o box.sft
  sample cornell.obj -o box_receivers.ply --count $receivers --emission --light-samples 64
  # The studio: in the sun, and black
  sample studio.obj -o studio.ply --count $surfels "${sun[@]}"
  index studio.ply -o studio.sft
  sample studio.obj -o studio_receivers.ply --count $receivers "${sun[@]}"
  sample studio.obj -o black.ply --count $surfels
  index black.ply -o black.sft
  sample studio.obj -o black_receivers.ply --count $receivers
}

direct() {
  say "Direct light, and color bleeding"
  draw studio_direct studio_receivers.ply --channel radiosity "${studio_view[@]}"
  draw studio_surfels studio.ply --radius-scale 0.5 --channel radiosity --fov 7 \
    --eye "$studio_eye" --look-at "1.3 0.8 0.9" --size 320x240
  gather studio.sft studio_receivers.ply -o studio_bleeding.ply --mode bleeding
  draw studio_bleeding studio_bleeding.ply --channel lit "${studio_view[@]}"
  draw studio_indirect studio_bleeding.ply --channel indirect --exposure 2.5 "${studio_view[@]}"
}

quality() {
  say "What the solid angle and the raster decide"
  local sigma pixels
  for sigma in 1 0.1 0.03; do
    gather studio.sft studio_receivers.ply -o sigma.ply --mode bleeding --max-solid-angle $sigma
    draw studio_sigma_$sigma sigma.ply --channel indirect --exposure 2.5 "${middle_view[@]}"
  done
  for pixels in 2 4 8; do
    gather studio.sft studio_receivers.ply -o pixels.ply --mode bleeding --max-solid-angle 0.03 \
      --raster-resolution $pixels
    draw studio_raster_$pixels pixels.ply --channel indirect --exposure 2.5 "${middle_view[@]}"
  done
}

area() {
  say "Area lights: lamps are bright surfels, the studio is black surfels"
  sample lamp_panel.obj -o panel.ply --count 30000 --emission
  sample lamp_ball.obj -o ball.ply --count 30000 --emission
  sample lamp_ring.obj -o ring.ply --count 30000 --emission
  # Every lamp is a group, and dimmer where it is looked at
  clouds join lamps.ply black.ply panel.ply,group=1 ball.ply,group=2 ring.ply,group=3
  clouds join lamps_receivers.ply black_receivers.ply panel.ply,dim=0.012 ball.ply,dim=0.012 \
    ring.ply,dim=0.012
  index lamps.ply -o lamps.sft
  gather lamps.sft lamps_receivers.ply -o area.ply --mode bleeding --sides both \
    --raster-resolution 24
  draw area_lights area.ply --channel lit --exposure 0.5 "${lamps_view[@]}"
}

subset() {
  say "One lamp alone, of the same scene"
  local lamp
  for lamp in 1 2 3; do
    gather lamps.sft lamps_receivers.ply -o lamp.ply --mode bleeding --sides both \
      --raster-resolution 24 --subset 0,$lamp
    draw subset_$lamp lamp.ply --channel lit --exposure 0.5 "${lamps_view[@]}"
  done
}

photons() {
  say "Photon maps"
  sample cornell.obj -o photons.ply --photons 1000000
  sample cornell.obj -o fewer_photons.ply --photons 40000
  draw photons_map fewer_photons.ply --channel power --exposure 13.5 --mode points \
    "${speckled_view[@]}"
  timed surfeit radiance photons.ply -o photon_radiosity.ply --photons-per-estimate 200
  draw photons_radiosity photon_radiosity.ply --channel radiosity --exposure -1 "${speckled_view[@]}"
  index photon_radiosity.ply -o photon_radiosity.sft
  gather photon_radiosity.sft box_receivers.ply -o photons_gathered.ply --mode bleeding
  draw photons_gathered photons_gathered.ply --channel lit --exposure -1 "${box_view[@]}"
}

environment() {
  say "Environment light"
  clouds sky sky.hdr sky.ply
  draw environment_map sky.ply --mode points --point-size 2 --channel radiosity --exposure -4.5 \
    --eye "256 128 400" --look-at "256 128 0" --fov 35.5 --size 512x256
  gather black.sft black_receivers.ply -o environment.ply --environment sky.hdr --up y \
    --raster-resolution 24 --outputs occlusion,bent_normal,environment
  draw environment environment.ply --channel lit --exposure -2.5 "${studio_view[@]}"
  draw bent_normal environment.ply --channel bent_normal "${studio_view[@]}"
}

bounces() {
  say "No bounce, one and two"
  draw bounces_0 box_receivers.ply --channel radiosity --exposure -1 "${box_view[@]}"
  gather box.sft box_receivers.ply -o bounces_1.ply --mode bleeding
  draw bounces_1 bounces_1.ply --channel lit --exposure -1 "${box_view[@]}"
  timed surfeit bounce box.sft -o box_1.sft --bounces 1
  gather box_1.sft box_receivers.ply -o bounces_2.ply --mode bleeding
  draw bounces_2 bounces_2.ply --channel lit --exposure -1 "${box_view[@]}"
}

occlusion() {
  say "Ambient occlusion, and its nine looks: max distance by cone angle"
  gather black.sft black_receivers.ply -o occlusion.ply
  draw occlusion occlusion.ply --channel ao "${studio_view[@]}"
  local distance cone
  for distance in 0.2 0.6 1e30; do
    for cone in 0.4 0.8 1.57; do
      gather black.sft black_receivers.ply -o look.ply --max-dist $distance --cone-angle $cone
      draw occlusion_${distance}_$cone look.ply --channel ao "${look_view[@]}"
    done
  done
}

glossy() {
  say "Glossy reflection, and reflection occlusion"
  local cone
  # Narrow cones see single surfels: they need more of them
  sample studio.obj -o fine.ply --count 1000000 "${sun[@]}"
  index fine.ply -o fine.sft
  for cone in 0.05 0.2 0.5; do
    gather fine.sft studio_receivers.ply -o glossy.ply --mode glossy --cone-angle $cone \
      --roughness 1 --camera "${studio_eye// /,}" --outputs occlusion,irradiance --sides both
    draw glossy_$cone glossy.ply --channel reflection "${studio_view[@]}"
    draw reflection_occlusion_$cone glossy.ply --channel ao "${studio_view[@]}"
  done
}

volume() {
  say "Light in a volume"
  sample cornell.obj -o box_lamp.ply --count $surfels --emission
  index box_lamp.ply -o box_lamp.sft
  # A slab across the box, and haze before its walls, which have their light already
  clouds slab slab.ply 200 0.5
  gather box_lamp.sft slab.ply -o slab_lit.ply --mode bleeding --sides both
  draw volume_slab slab_lit.ply --channel irradiance --exposure -2 "${box_view[@]}"
  clouds haze haze.ply 12000 1
  gather box_lamp.sft haze.ply -o haze_lit.ply --mode bleeding --sides both
  gather box.sft box_receivers.ply -o box_lit.ply --mode bleeding
  clouds join haze_in_box.ply box_lit.ply haze_lit.ply
  draw volume_haze haze_in_box.ply --channel lit --exposure -1.5 "${speckled_view[@]}"
}

cube() {
  say "The raster cube of a receiver on the floor, and of one on the ceiling"
  timed surfeit cube box.sft --at 0.5,0,0.6 --normal 0,1,0 -o "$pictures/cube_floor.png" --zoom 5 \
    --reference cornell.obj
  timed surfeit cube box.sft --at 0.25,1,0.75 --normal 0,-1,0 -o "$pictures/cube_ceiling.png" \
    --zoom 5 --exposure -1 --reference cornell.obj
}

# Surfels for the camera of the studio, and of a narrower view, seen from elsewhere
camera() {
  say "Surfels for a camera"
  local from=(--eye "10 10 13" --look-at "0 0 0.5" --fov 40 --size 480x360)
  local studio=(studio.obj --ground-plane --ground-size 4 "${sun[@]}" --size 560x420 --pixels 4)
  sample "${studio[@]}" -o camera.ply --camera "$studio_eye 0 0.3 0.1 37"
  draw camera_wide camera.ply --channel radiosity --radius-scale 0.5 "${from[@]}"
  sample "${studio[@]}" -o narrow.ply --camera "$studio_eye 1.3 0.8 0.9 8"
  draw camera_narrow narrow.ply --channel radiosity --radius-scale 0.5 "${from[@]}"
}

# A ball of glass and one that mirrors, on a floor
ball() { # MATERIAL X Z
  awk -v m="$1" -v x="$2" -v z="$3" 'BEGIN {
    print "usemtl " m
    for (i = 0; i <= 64; i++) for (k = 0; k < 128; k++) {
      t = 3.14159265 * i / 64; p = 3.14159265 * k / 64
      a = sin(t) * cos(p); b = cos(t); c = sin(t) * sin(p)
      printf "v %.6f %.6f %.6f\nvn %.6f %.6f %.6f\n", x + a, 1.01 + b, z + c, a, b, c
    }
    n = 65 * 128
    for (i = 0; i < 64; i++) for (k = 0; k < 128; k++) {
      q[0] = i * 128 + k; q[1] = i * 128 + (k + 1) % 128; q[2] = q[1] + 128; q[3] = q[0] + 128
      s = "f"; for (j = 0; j < 4; j++) s = s " " (q[j] - n) "//" (q[j] - n)
      print s
    }
  }'
}

caustics() {
  say "Caustics of glass and of a mirror"
  printf '%s\n' "newmtl floor" "Kd .7 .7 .7" "newmtl glass" "illum 7" "Ni 1.5" "Tf .9 .97 1" \
    "newmtl mirror" "Kd 0 0 0" "Ks .9 .8 .6" "illum 3" > balls.mtl
  {
    echo "mtllib balls.mtl"
    ball glass -1.4 0
    ball mirror 1.4 -0.4
    printf '%s\n' "usemtl floor" "v -5 0 5" "v 5 0 5" "v 5 0 -5" "v -5 0 -5" "f -4 -3 -2 -1"
  } > balls.obj
  sample balls.obj -o ball_photons.ply --photons 3000000 --caustic-photons caustic.ply "${sun[@]}"
  local view=(--channel radiosity --eye "0 6 8" --look-at "0.5 0 -0.6" --fov 40 --size 420x315)
  timed surfeit radiance caustic.ply -o caustic_radiosity.ply --photons-per-estimate 60
  timed surfeit radiance ball_photons.ply caustic.ply -o ball_radiosity.ply \
    --photons-per-estimate 60
  draw caustics_alone caustic_radiosity.ply "${view[@]}"
  draw caustics_all ball_radiosity.ply "${view[@]}"
}

pane() { # OPACITY COLOR X: a square above the floor
  printf '%s\n' "newmtl pane$1" "Kd $2" "d $1" >> panes.mtl
  printf '%s\n' "usemtl pane$1" "v $3 0.5 0.6" "v $3 0.5 -0.6" >> panes.obj
  awk -v x="$3" 'BEGIN { print "v", x + 1.2, "0.5 -0.6"; print "v", x + 1.2, "0.5 0.6"; print "f -4 -3 -2 -1" }' >> panes.obj
}

translucent() {
  say "Panes of opacity .2, .5 and 1 above a floor"
  printf '%s\n' "newmtl floor" "Kd .8 .8 .8" > panes.mtl
  echo "mtllib panes.mtl" > panes.obj
  pane 0.2 ".9 .2 .1" -2.2
  pane 0.5 ".1 .8 .2" -0.6
  pane 1 ".1 .3 .9" 1
  printf '%s\n' "mtllib panes.mtl" "usemtl floor" "v -3 0 2" "v 3 0 2" "v 3 0 -2" "v -3 0 -2" "f 1 2 3 4" > pane_floor.obj
  sample panes.obj -o panes.ply --count 100000 --two-sided "${sun[@]}"
  sample pane_floor.obj -o pane_floor.ply --count 200000
  index panes.ply -o panes.sft
  gather panes.sft pane_floor.ply -o pane_light.ply --mode bleeding
  local view=(--eye "0 5 5" --look-at "0 0 0.1" --fov 40 --size 420x240)
  draw translucent_ao pane_light.ply --channel ao "${view[@]}"
  draw translucent_light pane_light.ply --channel irradiance --exposure 1 "${view[@]}"
}

tints() {
  say "Filters of cyan, magenta and yellow glass above a floor"
  printf '%s\n' "newmtl floor" "Kd .8 .8 .8" "newmtl sky" "Kd 0 0 0" "Ke 1 1 1" > tints.mtl
  echo "mtllib tints.mtl" > tint_panes.obj
  local name filter x z y=0.1
  while read -r name filter x z; do
    y=$(awk -v y=$y 'BEGIN { print y + .4 }')
    printf '%s\n' "newmtl $name" "Kd 0 0 0" "d 0" "Tf ${filter//,/ }" >> tints.mtl
    awk -v name="$name" -v x="$x" -v y="$y" -v z="$z" 'BEGIN {
      print "usemtl", name
      for (i = 0; i < 4; i++) print "v", x + (i == 1 || i == 2 ? .9 : -.9), y, z + (i < 2 ? .9 : -.9)
      print "f -4 -3 -2 -1"
    }' >> tint_panes.obj
  done <<< "cyan .1,.95,.95 -0.5 0.3
magenta .95,.1,.95 0.5 0.3
yellow .95,.95,.1 0 -0.5"
  printf '%s\n' "mtllib tints.mtl" "usemtl sky" "v -6 4 -6" "v 6 4 -6" "v 6 4 6" "v -6 4 6" "f 1 2 3 4" > tint_sky.obj
  printf '%s\n' "mtllib tints.mtl" "usemtl floor" "v -3 0 2" "v 3 0 2" "v 3 0 -2" "v -3 0 -2" "f 1 2 3 4" > tint_floor.obj
  sample tint_floor.obj -o tint_floor.ply --count 200000
  index tint_floor.ply -o tint_floor.sft
  timed surfeit relight tint_floor.sft -o tint_sun.sft --mesh tint_panes.obj \
    --light-samples 64 --light-area "0 12 0  0.4 0 0  0 0 0.4  240 240 240"
  timed surfeit convert tint_sun.sft -o tint_sun.ply
  sample tint_panes.obj -o tint_panes.ply --count 100000 --two-sided
  sample tint_sky.obj -o tint_sky.ply --count 20000 --emission
  index tint_panes.ply tint_sky.ply -o tints.sft
  gather tints.sft tint_floor.ply -o tint_light.ply --mode bleeding
  local view=(--eye "0 5 5" --look-at "0 0 0.1" --fov 40 --size 420x240)
  draw tints_sun tint_sun.ply --channel radiosity --exposure 0 "${view[@]}"
  draw tints_sky tint_light.ply --channel irradiance --exposure -1.3 "${view[@]}"
}

hair() {
  say "A ball with fur"
  clouds fur fur.hair 12000
  {
    ball skin 0 0
    printf '%s\n' "usemtl floor" "v -5 0 5" "v 5 0 5" "v 5 0 -5" "v -5 0 -5" "f -4 -3 -2 -1"
  } > skin.obj
  sample skin.obj fur.hair -o furry.ply --count 250000 "${sun[@]}"
  local view=(--radius-scale 0.75 --eye "0 2.4 5.6" --look-at "0 1.15 0" --fov 34 --size 420x420)
  draw hair furry.ply --channel radiosity "${view[@]}"
  index furry.ply -o furry.sft
  gather furry.sft furry.ply -o fur_occlusion.ply
  draw hair_occlusion fur_occlusion.ply --channel ao "${view[@]}"
}

screen() {
  say "A screen whose picture lights the room"
  cp "$pictures/bounces_2.png" screen.png
  printf '%s\n' "newmtl wall" "Kd .7 .7 .7" "newmtl screen" "Kd 0 0 0" "Ke 6 6 6" \
    "map_Ke screen.png" > screen.mtl
  {
    printf '%s\n' "mtllib screen.mtl" "usemtl screen" "v -2 .3 -2" "v 2 .3 -2" "v 2 3.3 -2" \
      "v -2 3.3 -2" "vt 0 0" "vt 1 0" "vt 1 1" "vt 0 1" "f 1/1 2/2 3/3 4/4" "usemtl wall" \
      "v -4 0 3" "v 4 0 3" "v 4 0 -2.1" "v -4 0 -2.1" "f -4 -3 -2 -1" \
      "v -4 0 -2.1" "v 4 0 -2.1" "v 4 5 -2.1" "v -4 5 -2.1" "f -4 -3 -2 -1"
    ball wall 1.2 .6 | sed 's/^usemtl.*/usemtl wall/'
  } > screen.obj
  sample screen.obj -o screen.ply --count $fewer --light-samples 16
  sample screen.obj -o screen_glow.ply --count $fewer --light-samples 64 --emission
  index screen.ply -o screen.sft
  gather screen.sft screen_glow.ply -o screen_lit.ply --mode bleeding
  local view=(--eye "0 2.6 7.2" --look-at "0 1.5 0" --fov 38 --size 560x420)
  draw screen_lit screen_lit.ply --channel lit --exposure -1.6 "${view[@]}"
}

relit() {
  say "Key and fill as layers of one scene"
  local key="key=0.9 -1.6 -1.0  1.25 1.2 1.1" fill="fill=-1 -0.8 -0.3  .5 .7 1.1"
  local gains
  sample studio.obj -o few.ply --count 80000
  index few.ply -o few.sft
  for gains in key=1,fill=0 key=0,fill=1 key=.6,fill=1.6; do
    timed surfeit relight few.sft -o relit.sft --mesh studio.obj \
      --light-directional "$key" --light-directional "$fill" --gain $gains
    timed surfeit convert relit.sft -o relit.ply
    gather relit.sft relit.ply -o relit_lit.ply --mode bleeding
    draw relit_${gains//[^0-9]/} relit_lit.ply --channel lit "${middle_view[@]}"
  done
}

looked_up() {
  say "Baked light in a brick map, looked up at other surfels"
  sample cornell.obj -o bake_at.ply --count $fewer
  gather box.sft bake_at.ply -o bake.ply --mode bleeding
  timed surfeit brick bake.ply -o bake.vdb --channel irradiance --max-error 0.02
  sample cornell.obj -o other.ply --count 80000
  timed surfeit lookup bake.vdb other.ply -o looked_up.ply
  gather box.sft other.ply -o other_lit.ply --mode bleeding
  draw lookup_map looked_up.ply --channel irradiance "${box_view[@]}"
  draw lookup_gathered other_lit.ply --channel irradiance "${box_view[@]}"
}

look() {
  say "The look of bounce light"
  local at=(box.sft box_receivers.ply --mode bleeding)
  local view=(--channel lit --exposure -1 "${box_view[@]}")
  gather "${at[@]}" -o look_0.ply
  draw look_plain look_0.ply "${view[@]}"
  gather "${at[@]}" -o look_1.ply --bounce-saturation 0 --bounce-gain 1.5
  draw look_grey look_1.ply "${view[@]}"
  gather "${at[@]}" -o look_2.ply --bounce-filter "centre=.3,.46,.32 radius=.1,.6 gain=4 tint=1,.8,.4"
  draw look_sphere look_2.ply "${view[@]}"
  gather "${at[@]}" -o look_3.ply --bounce-filter "direction=0,-1,0 angle=10,70 tint=.2,.6,3"
  draw look_ceiling look_3.ply "${view[@]}"
}

brightness() {
  say "Occlusion by directions and by the brightness of the sky"
  clouds sky sky.hdr sky.ply
  gather black.sft black_receivers.ply -o bright.ply --environment sky.hdr --up y \
    --raster-resolution 24 --outputs occlusion --occlusion-by-brightness
  draw occlusion_by_brightness bright.ply --channel ao "${studio_view[@]}"
}

# A lamp in a square tube that points at the floor, before a wall
shiny() {
  say "A shiny tile that throws a patch of light onto the wall"
  printf '%s\n' "newmtl room" "Kd .5 .5 .5" "newmtl tile" "Kd .9 .8 .65" "newmtl lamp" "Kd 0 0 0" \
    "Ke 200 190 170" > shiny.mtl
  printf '%s\n' "mtllib shiny.mtl" "usemtl tile" "v -.45 .01 .75" "v .45 .01 .75" "v .45 .01 -.15" \
    "v -.45 .01 -.15" "f 1 2 3 4" > shiny_tile.obj
  printf '%s\n' "mtllib shiny.mtl" "usemtl room" "v -2.5 0 -2" "v 2.5 0 -2" "v 2.5 3 -2" \
    "v -2.5 3 -2" "v -2.5 0 3" "v 2.5 0 3" "f 1 2 3 4" "f 5 6 2 1" > shiny_room.obj
  printf '%s\n' "mtllib shiny.mtl" "usemtl lamp" "v -.1 1.5 2.1" "v .1 1.5 2.1" "v .1 1.5 2.3" \
    "v -.1 1.5 2.3" "f 1 2 3 4" > shiny_lamp.obj
  sample shiny_tile.obj -o tile.ply --count 20000
  sample shiny_room.obj -o room.ply --count $receivers
  sample shiny_lamp.obj -o lamp.ply --count 3000 --emission
  index room.ply --group tile=tile.ply --group lamp=lamp.ply -o hall.sft
  timed surfeit bounce hall.sft -o matt.sft
  timed surfeit bounce hall.sft -o shiny.sft --glossy tile=.9,.12
  local fine=(--mode bleeding --max-solid-angle .01 --raster-resolution 32) eye="1.9 1.6 5.4"
  local view=(--channel radiosity --exposure 2 --eye "$eye" --look-at "0 1.1 -.6" --fov 36 --size 480x360)
  local kind part
  for kind in matt shiny; do
    gather $kind.sft room.ply -o room_$kind.ply "${fine[@]}" --gain lamp=0
    gather $kind.sft tile.ply -o tile_$kind.ply "${fine[@]}"
    for part in room tile; do
      timed surfeit convert ${part}_$kind.ply -o ${part}_lit.ply --set "radiosity = albedo * irradiance"
    done
    clouds join $kind.ply room_lit.ply tile_lit.ply
    draw shiny_$kind $kind.ply "${view[@]}"
  done
  # The tile as the camera sees it: a tenth even, the rest its mirror image
  gather shiny.sft tile_shiny.ply -o tile_mirror.ply --mode glossy --roughness .12 --camera "${eye// /,}"
  timed surfeit convert tile_mirror.ply -o tile_lit.ply --set "radiosity = albedo * (.1 * irradiance + .9 * reflection)"
  clouds join shiny.ply room_lit.ply tile_lit.ply
  draw shiny_mirror shiny.ply "${view[@]}"
}

chapters=("$@")
if ((${#chapters[@]} == 0)); then
  chapters=(direct quality area subset photons environment bounces occlusion glossy volume cube
    camera caustics translucent tints hair screen relit looked_up look brightness shiny)
  scenes
elif [[ ! -e black_receivers.ply ]]; then
  scenes
fi
for chapter in "${chapters[@]}"; do "$chapter"; done
say "Done: $pictures"
