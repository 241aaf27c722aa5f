# %% [markdown]
# Memory against reads
#
# How much memory does a gather need? `surfeit.tune` follows the look-ups of a sample of the
# receivers and predicts hits and reads for caches of any size: a miss-ratio curve.

# %%
import matplotlib.pyplot as plt
import numpy as np

import surfeit

# Walls of a maze, far apart, so that no receiver sees much of it
rng = np.random.default_rng(3)
cells = rng.integers(0, 40, (150_000, 2)) * 2.0
along = rng.uniform(-1, 1, (150_000, 2))
points = np.stack([cells[:, 0] + along[:, 0], along[:, 1], cells[:, 1]], axis=1)
normals = np.tile([0.0, 0.0, 1.0], (len(points), 1)).astype(np.float32)
cloud = {
    "position": points.astype(np.float32),
    "normal": normals,
    "area": np.full(len(points), 0.04, np.float32),
    "two_sided": np.ones(len(points), np.uint8),
}
surfeit.index(cloud, "maze.sft")
surfeit.write("receivers.ply", {"position": points[:20_000] + 0.05, "normal": normals[:20_000]})

# %%
report = surfeit.tune("maze.sft", "receivers.ply", memory="256M", sample_receivers=5_000)
curve = report["curve"]
megabytes = [row["cache_bytes"] / 2**20 for row in curve]
for kind in ("node", "surfel"):
    misses = [100 * (1 - row["predicted"][f"{kind}_cache"]["hit_rate"]) for row in curve]
    plt.plot(megabytes, misses, label=f"{kind} cache")
    assert misses[0] >= misses[-1]
plt.axvline(report["recommended"]["cache_bytes"] / 2**20, ls=":", c="k", label="recommended")
plt.xlabel("memory of both caches, MiB")
plt.ylabel("reads, % of the look-ups")
plt.legend()
plt.savefig("miss_ratio.png", dpi=100)
print(f"recommended: {report['recommended']['memory_bytes'] / 2**20:.0f} MiB")

# %% [markdown]
# An engine tells afterwards what its caches did.

# %%
engine = surfeit.Engine(memory=report["recommended"]["memory_bytes"] + (64 << 20), threads=2)
engine.open("maze.sft").gather(points[:20_000] + 0.05, normals[:20_000], quality="draft")
cache = engine.stats["node_cache"]
print(f"node cache: {cache['requests']} look-ups, {cache['misses']} misses")
