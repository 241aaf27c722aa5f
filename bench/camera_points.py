#!/usr/bin/env python3
"""Surfels for a camera beside surfels at one density: a street of the generated city.

  bench/camera_points.py [--build build/dev] [--work DIR] [--size 512x256] [--frames 24]

Meshes the city around a street (city_mesh), takes the places that the pixels of a picture see as
receivers, and gathers occlusion at them from surfels for the camera and from surfels at one density.
Errors are RMSE against the finest surfels of both kinds: those for half a pixel, and 16 M at one
density. Then a camera that
moves along the street: every frame has surfels of its own, and receivers stay where they are; what
is printed is the root of the mean square of second differences from frame to frame. Surfels at one
density do not depend on a camera: for them the number of surfels changes by 1 % per frame, so that
they, too, are cut anew.
"""

import argparse
import json
import math
import os
import statistics
import struct
import subprocess
import sys

TYPES = {"float": "f", "double": "d", "uchar": "B", "int": "i", "uint": "I", "ushort": "H",
         "float32": "f", "float64": "d", "uint8": "B", "int32": "i", "uint32": "I"}


def read_ply(path, names):
    """Columns of the vertices of a binary PLY file."""
    with open(path, "rb") as file:
        fields, code, count, in_vertex = [], "<", 0, False
        for line in iter(file.readline, b"end_header\n"):
            words = line.decode().split()
            if words[0] == "element":
                in_vertex = words[1] == "vertex"
                count = int(words[2]) if in_vertex else count
            elif words[0] == "property" and in_vertex:
                fields.append(words[2])
                code += TYPES[words[1]]
        row = struct.Struct(code)
        rows = list(row.iter_unpack(file.read(count * row.size)))
        return [[values[fields.index(name)] for values in rows] for name in names]


def rms(values):
    return math.sqrt(sum(value * value for value in values) / len(values))


class Bench:
    def __init__(self, arguments):
        self.programs = arguments.build
        self.work = arguments.work
        self.size = arguments.size
        self.threads = str(arguments.threads)
        self.memory = ["--memory", arguments.memory] if arguments.memory else []
        self.finest = arguments.finest
        os.makedirs(self.work, exist_ok=True)

    def path(self, name):
        return os.path.join(self.work, name)

    def run(self, *words):
        """Runs surfeit and returns its statistics."""
        stats = self.path("stats.json")
        command = [os.path.join(self.programs, "bin/surfeit"), *map(str, words), "--quiet"]
        subprocess.run([*command, "--stats", stats], check=True)
        with open(stats) as file:
            return json.load(file)

    def camera(self, shift=0.0):
        places = [self.eye[0], self.eye[1] + shift, self.eye[2],
                  self.look[0], self.look[1] + shift, self.look[2]]
        text = " ".join(f"{value:.4f}" for value in places)
        return ["--camera", text, "--fov", 50, "--size", self.size]

    def make_city(self):
        mesh = self.path("city.ply")
        if not os.path.exists(mesh):
            program = os.path.join(self.programs, "bench/city_mesh")
            subprocess.run([program, "500", "490", "130", "16", mesh], check=True)
        self.mesh = mesh
        places = zip(*read_ply(mesh, ["x", "y", "z"]))
        ground = statistics.median(z for x, y, z in places if math.hypot(x - 500, y - 420) < 9)
        self.eye = [500.0, 420.0, ground + 1.8]
        self.look = [500.0, 450.0, ground + 4.0]

    def make_receivers(self):
        """Every so many pixels that see something."""
        made = self.sample("finest", *self.camera(), "--pixels", self.finest, "--max-solid-angle", 0.01)
        print(f"finest for the camera: {made['surfels']} surfels for {self.finest} pixels, .01 sr")
        view = ["--eye", " ".join(map(str, self.eye)), "--look-at", " ".join(map(str, self.look)),
                "--up", "z", "--fov", 50, "--size", self.size]
        stats = self.run("view", self.path("finest.ply"), "--passes", self.path("passes.exr"),
                         "-o", self.path("street.png"), "--channel", "normal", *view)
        self.run("convert", self.path("passes.exr"), "-o", self.path("receivers.ply"), "--filter",
                 "depth < 1e6", "--every", self.every)
        print(f"{stats['pass_pixels']} pixels see the city; every {self.every}th is a receiver")

    def sample(self, name, *options):
        """Samples and indexes; returns surfels, seconds and bytes."""
        sampled = self.run("sample", self.mesh, "-o", self.path(name + ".ply"), "--up", "z",
                           "--threads", self.threads, *self.lights, *options)
        indexed = self.run("index", self.path(name + ".ply"), "-o", self.path(name + ".sft"),
                           "--threads", self.threads, *self.memory)
        return {"surfels": sampled["surfels"],
                "sample": sampled["cpu_seconds"], "index": indexed["cpu_seconds"],
                "bytes": os.path.getsize(self.path(name + ".sft")), "area": sampled["surfel_area"]}

    def gather(self, name, columns, receivers="receivers.ply", mode="occlusion"):
        stats = self.run("gather", self.path(name + ".sft"), self.path(receivers), "-o",
                         self.path("baked.ply"), "--mode", mode, "--threads", self.threads,
                         *self.memory)
        return read_ply(self.path("baked.ply"), columns), stats

    def errors(self, even_count, pixels, counts):
        (truth,), _ = self.gather("finest", ["occlusion"])
        self.sample("some", "--count", even_count)
        (even_truth,), _ = self.gather("some", ["occlusion"])
        between = rms([a - b for a, b in zip(truth, even_truth)])
        even = f"{even_count / 1e6:g} M"
        print(f"RMSE between the finest for the camera and {even} at one density: {between:.4f}")
        print(f"{'surfels for':24} {'surfels':>10} {'scene MB':>9} {'sample s':>9} {'index s':>8} "
              f"{'gather s':>9} {'peak MB':>8} {'RMSE':>8} {'of ' + even:>8}", flush=True)
        rows = [(f"camera, {p} pixels, {w} sr",
                 [*self.camera(), "--pixels", p, "--max-solid-angle", w])
                for p, w in pixels]
        rows += [(f"uniform, {n / 1e6:g} M", ["--count", n])
                 for n in counts]
        for name, options in rows:
            made = self.sample("some", *options)
            (occlusion,), stats = self.gather("some", ["occlusion"])
            error = rms([a - b for a, b in zip(occlusion, truth)])
            even_error = rms([a - b for a, b in zip(occlusion, even_truth)])
            print(f"{name:24} {made['surfels']:10} {made['bytes'] / 1e6:9.1f} {made['sample']:9.2f} "
                  f"{made['index']:8.2f} {stats['cpu_seconds']:9.2f} "
                  f"{stats['peak_resident_bytes'] / 1e6:8.0f} {error:8.4f} "
                  f"{even_error:8.4f}", flush=True)

    def flicker(self, frames, count_of_first):
        """Second differences at receivers that stay, of a camera that goes 10 cm a frame."""
        self.run("convert", self.path("receivers.ply"), "-o", self.path("few.ply"), "--every", 8)
        for name in self.kinds:
            values = []
            count = 0
            for frame in range(frames):
                if name == "camera":
                    options = [*self.camera(0.1 * frame), "--pixels", 1.5]
                else:
                    options = ["--count", round(count_of_first * 1.01 ** frame)]
                count = self.sample("frame", *options)["surfels"]
                (occlusion, *rgb), _ = self.gather(
                    "frame", ["occlusion", "irradiance_r", "irradiance_g", "irradiance_b"],
                    "few.ply", "bleeding")
                values.append((occlusion, [sum(color) / 3 for color in zip(*rgb)]))
            print(f"{name}: {frames} frames, {count} surfels in the last, {len(values[0][0])} receivers")
            for i, what in enumerate(("occlusion", "irradiance")):
                series = [value[i] for value in values]
                second = sorted(abs(a - 2 * b + c) for first, middle, last in
                                zip(series, series[1:], series[2:])
                                for a, b, c in zip(first, middle, last))
                scale = 1 if i == 0 else statistics.fmean(map(statistics.fmean, series))
                print(f"  {what}: second differences RMS {rms(second) / scale:.5f}, 99 % below "
                      f"{second[len(second) * 99 // 100] / scale:.5f}, largest "
                      f"{second[-1] / scale:.4f}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--build", default="build/dev")
    parser.add_argument("--work", default="out/camera_points")
    parser.add_argument("--size", default="512x256")
    parser.add_argument("--every", type=int, default=4, help="pixels per receiver")
    parser.add_argument("--memory", help="budget of indexing and gathering")
    parser.add_argument("--finest", type=float, default=0.5, help="pixels, for the reference")
    parser.add_argument("--even-finest", type=int, default=16, help="M, of the other reference")
    parser.add_argument("--pixels", nargs="+", default=["3,0.1", "3,0.03", "1.5,0.1", "1.5,0.03", "1,0.03"],
                        help="for the camera: pixels and greatest solid angle")
    parser.add_argument("--uniform", nargs="+", type=float, default=[0.5, 1, 2, 4, 8],
                        help="M, at one density")
    parser.add_argument("--frames", type=int, default=24)
    parser.add_argument("--frames-uniform", type=float, default=1,
                        help="M at one density, in the first frame")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--only", choices=["errors", "flicker"])
    parser.add_argument("--kinds", nargs="+", default=["camera", "uniform"], help="of the frames")
    arguments = parser.parse_args()
    bench = Bench(arguments)
    bench.every = arguments.every
    bench.kinds = arguments.kinds
    bench.lights = ["--light-directional", "-0.5 0.4 -0.8  3 3 3"]
    bench.make_city()
    bench.make_receivers()
    if arguments.only != "flicker":
        bench.errors(arguments.even_finest * 1_000_000,
                     [tuple(map(float, row.split(","))) for row in arguments.pixels],
                     [round(millions * 1e6) for millions in arguments.uniform])
    if arguments.only != "errors":
        bench.flicker(arguments.frames, round(arguments.frames_uniform * 1e6))
    return 0


if __name__ == "__main__":
    sys.exit(main())
