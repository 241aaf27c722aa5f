# %% [markdown]
# Clouds of other libraries
#
# Open3D, trimesh and laspy keep points, normals and colors as arrays of float64 with n rows. They go
# in as they are: nothing is copied, and no file is written for the receivers. `PointCloud` stands
# for Open3D's class here, so that this runs without it: `np.asarray(pcd.points)` is the same array.

# %%
import time
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np

import surfeit

count = 60_000
i = np.arange(count) + 0.5
polar, turn = np.arccos(1 - 2 * i / count), np.pi * (1 + 5**0.5) * i
normals = np.stack([np.cos(turn) * np.sin(polar), np.cos(polar), np.sin(turn) * np.sin(polar)], 1)
radius = 1 + 0.15 * np.sin(6 * turn)[:, None] * np.sin(polar)[:, None] ** 2
pcd = SimpleNamespace(
    points=normals * radius,
    normals=normals,
    colors=np.stack([0.5 + 0.5 * normals[:, 0], np.full(count, 0.5), 0.5 - 0.5 * normals[:, 0]], 1),
)

# %%
surfeit.index({"position": pcd.points, "normal": pcd.normals, "albedo": pcd.colors}, "ball.sft")
scene = surfeit.Engine(memory="256M").open("ball.sft")
begin = time.perf_counter()
occlusion = scene.gather(pcd.points, pcd.normals, quality="draft")["occlusion"]
print(f"arrays: {count / (time.perf_counter() - begin):.0f} receivers/s")

# %% [markdown]
# The way over files gives the same numbers.

# %%
begin = time.perf_counter()
surfeit.write("ball.ply", {"position": pcd.points, "normal": pcd.normals.astype(np.float32)})
surfeit.gather("ball.sft", "ball.ply", "baked.ply", quality="draft", memory="256M")
from_file = surfeit.read("baked.ply", only="occlusion")["occlusion"]
print(f"files: {count / (time.perf_counter() - begin):.0f} receivers/s")
assert np.array_equal(from_file, occlusion)

# %% [markdown]
# Open3D estimates normals from 30 neighbours; `surfeit.normals` does so in a memory budget. Both
# agree with the true normals, up to the sign.

# %%
surfeit.write("bare.ply", {"position": pcd.points})
surfeit.normals("bare.ply", "found.ply", toward="outward")
found = surfeit.read("found.ply", only="normal")["normal"]
off = np.degrees(np.arccos(np.clip(np.abs((found * pcd.normals).sum(1)), 0, 1)))
print(f"normals: {np.median(off):.1f} degrees from the sphere's, which has no dents")

# %%
plt.scatter(pcd.points[:, 0], pcd.points[:, 1], c=occlusion, s=0.5)
plt.gca().set_aspect("equal")
plt.colorbar(label="occlusion")
plt.savefig("ball.png", dpi=100)
