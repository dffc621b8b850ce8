"""Fits the random walk's profile: walks in an isotropic half-space, and mixtures of three exponentials for each.

    python tools/fit_walk.py

Prints the rows of RANDOM_WALK in addon/kernels/diffusion.py (two minutes), and the largest difference between the
walks' and the mixture's cumulative distribution of distances.
"""

import numpy as np

ABSORPTIONS = (.005, .01, .02, .03, .04, .06, .09, .12, .16, .2, .25, .3, .36, .42, .5, .6, .7, .8, .9)  # fmt: skip
COSINE = 0.9  # at which walks enter
WALKS, STEPS, ROUNDS = 100_000, 20_000, 400
LEAST_WEIGHT = 0.02  # from which on half of the walks end by lot


def walks(absorption: float, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Distances from where they entered, in mean free paths, at which walks come out, and what is left of each."""
    albedo, sine = 1.0 - absorption**2, np.sqrt(1.0 - COSINE**2)
    place, weight = np.zeros((WALKS, 3)), np.ones(WALKS)
    turn = random.uniform(0.0, 2.0 * np.pi, WALKS)
    direction = np.stack([sine * np.cos(turn), sine * np.sin(turn), np.full(WALKS, COSINE)], axis=1)
    distances, weights = [], []
    for _ in range(STEPS):
        step = -np.log(1.0 - random.random(len(place)))[:, None]
        after = place + step * direction
        out = after[:, 2] < 0.0
        exits = place[out] - direction[out] * (place[out, 2] / direction[out, 2])[:, None]
        distances.append(np.hypot(exits[:, 0], exits[:, 1]))
        weights.append(weight[out])
        place, weight = after[~out], weight[~out] * albedo
        live = (weight > LEAST_WEIGHT) | (random.random(len(weight)) < 0.5)
        place, weight = place[live], np.where(weight > LEAST_WEIGHT, weight, 2.0 * weight)[live]
        if not len(place):
            break
        height, turn = random.uniform(-1.0, 1.0, len(place)), random.uniform(0.0, 2.0 * np.pi, len(place))
        ring = np.sqrt(1.0 - height**2)
        direction = np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=1)
    return np.concatenate(distances), np.concatenate(weights)


def mixture(distance: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shares and scales of three exponentials, by expectation maximisation over 600 bins."""
    weight = weight / weight.sum()
    scale, share = (distance * weight).sum() * np.array([0.25, 0.8, 2.2]), np.full(3, 1.0 / 3.0)
    edges = np.unique(np.concatenate([[0.0], np.quantile(distance, np.linspace(0.0, 1.0, 600))[1:]]))
    count = np.histogram(distance, edges, weights=weight)[0]
    middle = np.histogram(distance, edges, weights=weight * distance)[0] / np.maximum(count, 1e-30)
    middle, count = middle[count > 0], count[count > 0]
    for _ in range(ROUNDS):
        density = share / scale * np.exp(-middle[:, None] / scale)
        part = density / density.sum(axis=1, keepdims=True) * count[:, None]
        share = part.sum(axis=0)
        scale = (part * middle[:, None]).sum(axis=0) / np.maximum(share, 1e-12)
        share /= share.sum()
    order = np.argsort(scale)
    return share[order], scale[order]


def main() -> None:
    random = np.random.default_rng(1)
    for absorption in ABSORPTIONS:
        distance, weight = walks(absorption, random)
        share, scale = mixture(distance, weight)
        order = np.argsort(distance)
        within = np.cumsum(weight[order]) / weight.sum()
        fitted = 1.0 - (share * np.exp(-distance[order][:, None] / scale)).sum(axis=1)
        row = ", ".join(f"{number:.4f}" for number in (*share[:2], *scale))
        print(f"    ({absorption}, {row}),  # {np.abs(within - fitted).max():.4f}")


if __name__ == "__main__":
    main()
