# %% [markdown]
# A Cornell box of arrays
#
# Surfels need no mesh. Here five walls and a light are drawn as grids of surfels. The light sends
# radiosity; one bounce makes direct light, another one indirect light.

# %%
import matplotlib.pyplot as plt
import numpy as np

import surfeit

SIDE = 90
GREY, RED, GREEN = (0.75, 0.75, 0.75), (0.63, 0.06, 0.05), (0.14, 0.45, 0.09)


def wall(corner, u, v, albedo, radiosity=0.0, side=SIDE):
    """A grid of side x side surfels on the parallelogram of u and v; u x v points to its front."""
    u, v = np.array(u, float), np.array(v, float)
    middle = (np.arange(side) + 0.5) / side
    a, b = (grid.ravel()[:, None] for grid in np.meshgrid(middle, middle))
    cross = np.cross(u, v)
    count = side * side
    return {
        "position": (np.array(corner) + a * u + b * v).astype(np.float32),
        "normal": np.tile(cross / np.linalg.norm(cross), (count, 1)).astype(np.float32),
        "area": np.full(count, np.linalg.norm(cross) / count, np.float32),
        "albedo": np.tile(np.float32(albedo), (count, 1)),
        "radiosity": np.full((count, 3), radiosity, np.float32),
    }


parts = [
    wall((0, 0, 0), (0, 0, 1), (1, 0, 0), GREY),  # floor
    wall((0, 1, 0), (1, 0, 0), (0, 0, 1), GREY),  # ceiling
    wall((0, 0, 0), (1, 0, 0), (0, 1, 0), GREY),  # back
    wall((0, 0, 0), (0, 1, 0), (0, 0, 1), RED),  # left
    wall((1, 0, 0), (0, 0, 1), (0, 1, 0), GREEN),  # right
    wall((0.35, 0.99, 0.35), (0.3, 0, 0), (0, 0, 0.3), (0, 0, 0), radiosity=12.0, side=30),
]
box = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
surfeit.index(box, "box.sft")
surfeit.bounce("box.sft", "lit.sft", bounces=2, quality="draft")

# %% [markdown]
# A picture: the place and normal that each pixel sees, and the light that arrives there.

# %%
HEIGHT = WIDTH = 96
eye = np.array([0.5, 0.5, 2.4])
grid = (np.arange(WIDTH) + 0.5) / WIDTH - 0.5
directions = np.zeros((HEIGHT, WIDTH, 3))
directions[..., 0], directions[..., 1], directions[..., 2] = grid, -grid[:, None], -1.35
planes = [(1, 0.0, 0), (1, 1.0, 1), (2, 0.0, 2), (0, 0.0, 3), (0, 1.0, 4)]  # axis, place, part
nearest = np.full((HEIGHT, WIDTH), np.inf)
part = np.zeros((HEIGHT, WIDTH), int)
for axis, place, number in planes:
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (place - eye[axis]) / directions[..., axis]
    hit = eye + distance[..., None] * directions
    inside = (distance > 0) & (distance < nearest) & ((hit > -1e-6) & (hit < 1 + 1e-6)).all(-1)
    nearest[inside], part[inside] = distance[inside], number
seen = np.isfinite(nearest)
places = eye + np.where(seen, nearest, 0)[..., None] * directions
normals = np.array([each["normal"][0] for each in parts])[part]
albedo = np.array([each["albedo"][0] for each in parts])[part]

scene = surfeit.Engine(memory="256M").open("lit.sft")
light = scene.gather(places, normals, mode="bleeding", quality="draft")
picture = np.where(seen[..., None], albedo * light["irradiance"] / np.pi, 0)

# %% [markdown]
# The floor is red beside the red wall and green beside the green one.

# %%
floor = seen & (part == 0)
left, right = floor & (places[..., 0] < 0.15), floor & (places[..., 0] > 0.85)
ratio = [float(picture[at][:, 0].mean() / picture[at][:, 1].mean()) for at in (left, right)]
print(f"red over green of the floor: {ratio[0]:.2f} on the left, {ratio[1]:.2f} on the right")
assert ratio[0] > 1.1 * ratio[1]
plt.imsave("box.png", np.clip(picture / np.percentile(picture, 99), 0, 1) ** (1 / 2.2))
