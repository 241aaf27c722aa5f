# %% [markdown]
# Ambient occlusion of a scan
#
# A scan has positions, and often nothing else. Normals come from the neighbours, sizes too. Here
# the scan is made up: hills with boulders, 120,000 points with noise, in no order. For a scan of
# your own, pass its path to `surfeit.normals`.

# %%
import matplotlib.pyplot as plt
import numpy as np

import surfeit

rng = np.random.default_rng(7)
x, z = rng.uniform(-10, 10, (2, 90_000))
height = np.sin(0.9 * x) * np.cos(0.7 * z) + 0.3 * np.sin(2.3 * x + 1.1 * z)
hills = np.stack([x, height, z], axis=1)

centres = np.stack([rng.uniform(-9, 9, 40), np.zeros(40), rng.uniform(-9, 9, 40)], axis=1)
centres[:, 1] = np.sin(0.9 * centres[:, 0]) * np.cos(0.7 * centres[:, 2]) + 0.3
directions = rng.normal(size=(40, 750, 3))
directions /= np.linalg.norm(directions, axis=2, keepdims=True)
boulders = (centres[:, None] + 0.6 * directions).reshape(-1, 3)

points = np.concatenate([hills, boulders]) + rng.normal(scale=0.004, size=(120_000, 3))
surfeit.write("scan.ply", {"position": points.astype(np.float32)}, up="y")

# %% [markdown]
# Normals that point up, and the scene.

# %%
stats = surfeit.normals("scan.ply", "normals.ply", toward="up")
print(f"normals of {stats['points']} points, mean confidence {stats['mean_confidence']:.2f}")
stats = surfeit.index("normals.ply", "scan.sft", memory="256M")
print(f"scene: {stats['file_bytes'] / stats['surfels']:.1f} bytes per surfel")

# %% [markdown]
# Occlusion at the points themselves. A larger bias keeps the noise of the scan from covering it.

# %%
cloud = surfeit.read("normals.ply", only=["position", "normal"])
scene = surfeit.Engine(memory="256M").open("scan.sft")
found = scene.gather(cloud["position"], cloud["normal"], quality="draft", bias=0.5)
occlusion = found["occlusion"]
print(f"occlusion: mean {np.nanmean(occlusion):.3f}, most {np.nanmax(occlusion):.3f}")
assert 0.02 < np.nanmean(occlusion) < 0.6

# %%
plt.figure(figsize=(7, 6))
order = np.argsort(cloud["position"][:, 1])
place = cloud["position"][order]
plt.scatter(place[:, 0], place[:, 2], c=1 - occlusion[order], s=1, cmap="gray", vmin=0, vmax=1)
plt.gca().set_aspect("equal")
plt.colorbar(label="open part")
plt.savefig("occlusion.png", dpi=100)
