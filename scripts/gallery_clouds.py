#!/usr/bin/env python3
"""What scripts/gallery.sh needs beside the scenes of examples/: clouds joined, haze, a sky.

  gallery_clouds.py join OUT.ply IN.ply[,group=G][,dim=FACTOR]...
      The records of all clouds in one, with the properties of all; what a cloud lacks is 0.
      `group` adds that property, `dim` multiplies radiosity.
  gallery_clouds.py haze OUT.ply COUNT DEPTH
      Small spheres at random in the box of examples/cornell_scene.cpp, behind z = DEPTH.
  gallery_clouds.py slab OUT.ply COUNT DEPTH
      COUNT^2 spheres side by side in the plane z = DEPTH of that box.
  gallery_clouds.py sky OUT.hdr OUT.ply
      A lat-long picture of a dim sky with four small bright spots, and a cloud that shows it.
  gallery_clouds.py fur OUT.hair STRANDS
      Strands on the unit sphere about (0, 1, 0), longer on top, each bent down by its weight.
"""
import math
import operator
import random
import struct
import sys

TYPES = {"float": "f", "uchar": "B"}


def read_cloud(path):
    """Names, struct letters and records (tuples) of what `surfeit` writes."""
    with open(path, "rb") as file:
        names, letters, count = [], "", 0
        for line in iter(file.readline, b"end_header\n"):
            words = line.decode().split()
            if words[:2] == ["element", "vertex"]:
                count = int(words[2])
            elif words[0] == "property":
                letters += TYPES[words[1]]
                names.append(words[2])
        row = struct.Struct("<" + letters)
        return names, letters, list(row.iter_unpack(file.read(row.size * count)))


def write_cloud(path, names, letters, records):
    words = {letter: word for word, letter in TYPES.items()}
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(records)}"]
    header += [f"property {words[letter]} {name}" for letter, name in zip(letters, names)]
    row = struct.Struct("<" + letters)
    with open(path, "wb") as file:
        file.write(("\n".join(header + ["end_header"]) + "\n").encode())
        file.write(b"".join(row.pack(*record) for record in records))


def join(output, *inputs):
    clouds, names, letters = [], [], ""
    for item in inputs:
        path, *settings = item.split(",")
        settings = dict(setting.split("=") for setting in settings)
        its_names, its_letters, records = read_cloud(path)
        if "dim" in settings:
            factors = [float(settings["dim"]) if name.startswith("radiosity_") else 1
                       for name in its_names]
            records = [tuple(map(operator.mul, record, factors)) for record in records]
        if "group" in settings:
            its_names, its_letters = its_names + ["group"], its_letters + "B"
            records = [record + (int(settings["group"]),) for record in records]
        clouds.append((its_names, records))
        for name, letter in zip(its_names, its_letters):
            if name not in names:
                names.append(name)
                letters += letter
    joined = []
    for its_names, records in clouds:
        # What the cloud lacks comes from a 0 at the end
        columns = [its_names.index(name) if name in its_names else len(its_names) for name in names]
        pick = operator.itemgetter(*columns)
        joined += [pick(record + (0,)) for record in records]
    write_cloud(output, names, letters, joined)


def write_spheres(output, positions, radius):
    names = ["x", "y", "z", "radius", "albedo_r", "albedo_g", "albedo_b"]
    write_cloud(output, names, "f" * 7, [(*p, radius, 1.0, 1.0, 1.0) for p in positions])


def haze(output, count, depth):
    number = random.Random(1).random
    positions = [(number(), number(), float(depth) * number()) for _ in range(int(count))]
    write_spheres(output, positions, 0.0035)


def slab(output, count, depth):
    at = [(i + 0.5) / int(count) for i in range(int(count))]
    write_spheres(output, [(x, y, float(depth)) for y in at for x in at], 0.7 / int(count))


def sky_radiance(longitude, latitude):
    """Radiance of a direction; longitude as on the picture, -pi on its left."""
    spots = [  # longitude, latitude, angular radius, color
        (-0.6, 0.75, 0.09, (110, 105, 95)),
        (2.4, 0.5, 0.12, (50, 52, 56)),
        (-1.9, 0.35, 0.14, (4, 45, 8)),
        (1.0, 0.3, 0.14, (6, 14, 60)),
    ]
    direction = (math.cos(latitude) * math.cos(longitude), math.cos(latitude) * math.sin(longitude),
                 math.sin(latitude))
    for spot_longitude, spot_latitude, radius, color in spots:
        spot = (math.cos(spot_latitude) * math.cos(spot_longitude),
                math.cos(spot_latitude) * math.sin(spot_longitude), math.sin(spot_latitude))
        if sum(a * b for a, b in zip(direction, spot)) > math.cos(radius):
            return color
    t = max(0.0, math.sin(latitude))
    return (0.10 + 0.02 * t, 0.10 + 0.06 * t, 0.10 + 0.14 * t) if latitude > 0 else (0.05,) * 3


def sky(picture, cloud):
    columns, rows = 512, 256
    texels, records = bytearray(), []
    for row in range(rows):
        for column in range(columns):
            longitude = 2 * math.pi * ((column + 0.5) / columns - 0.5)
            latitude = math.pi * (0.5 - (row + 0.5) / rows)
            color = sky_radiance(longitude, latitude)
            _, exponent = math.frexp(max(color))
            texels += bytes(int(math.ldexp(c, 8 - exponent)) for c in color)
            texels.append(exponent + 128)
            records.append((column + 0.5, rows - row - 0.5, 0.0, *color))
    with open(picture, "wb") as file:
        file.write(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (rows, columns))
        file.write(texels)
    write_cloud(cloud, ["x", "y", "z", "radiosity_r", "radiosity_g", "radiosity_b"], "f" * 6, records)


def fur(output, strands):
    number = random.Random(2).random
    segments, points, colors = 8, bytearray(), bytearray()
    for i in range(int(strands)):
        height = 1 - (2 * i + 1) / int(strands)
        angle, across = 2.39996323 * i, math.sqrt(1 - height * height)
        out = (across * math.cos(angle), height, across * math.sin(angle))
        length = (0.25 + 0.2 * max(0.0, height)) * (0.7 + 0.6 * number())
        lean = [0.5 * (number() - 0.5) for _ in range(3)]
        shade = 0.6 + 0.4 * number()
        for k in range(segments + 1):
            t = length * k / segments
            at = [o + t * (o + l) for o, l in zip(out, lean)]
            points += struct.pack("<3f", at[0], 1 + at[1] - 1.1 * t * t, at[2])
            colors += struct.pack("<3f", 0.85 * shade, 0.62 * shade, 0.4 * shade)
    count = int(strands) * (segments + 1)
    # Points and colors as arrays, all else the same for all: 2 and 16 of the flags
    header = struct.pack("<4s3I", b"HAIR", int(strands), count, 2 | 16)
    header += struct.pack("<I5f", segments, 0.012, 0.0, 1.0, 1.0, 1.0) + bytes(88)
    with open(output, "wb") as file:
        file.write(header + points + colors)


COMMANDS = {"fur": fur, "join": join, "haze": haze, "slab": slab, "sky": sky}

if __name__ == "__main__":
    if len(sys.argv) < 3 or sys.argv[1] not in COMMANDS:
        sys.exit(__doc__)
    COMMANDS[sys.argv[1]](*sys.argv[2:])
