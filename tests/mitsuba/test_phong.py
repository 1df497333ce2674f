"""The Phong material that Mitsuba lacks: its formula, its symmetry, its energy, its sampling."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from miplight.mitsuba import plugins
from tests.mitsuba.closed_forms import phong

pytestmark = pytest.mark.mitsuba

Z = (0.0, 0.0, 1.0)
DIFFUSE, SPECULAR = np.array((0.3, 0.2, 0.1)), np.array((0.2, 0.5, 0.9))


def make(mi: Any, n: float, diffuse: Any = DIFFUSE, specular: Any = SPECULAR, two_sided: bool = False) -> Any:
    plugins.register(mi)
    node = {
        "type": plugins.PHONG,
        "diffuse_reflectance": {"type": "rgb", "value": list(diffuse)},
        "specular_reflectance": {"type": "rgb", "value": list(specular)},
        "shininess": float(n),
    }
    return mi.load_dict({"type": "twosided", "bsdf": node} if two_sided else node)


def vectors(mi: Any, array: NDArray[np.float64]) -> Any:
    return mi.Vector3f(np.ascontiguousarray(array.T, dtype=np.float32))


def at(mi: Any, wi: NDArray[np.float64]) -> Any:
    import drjit as dr

    si = dr.zeros(mi.SurfaceInteraction3f, len(wi))
    si.wi = vectors(mi, wi)
    return si


def evaluate(mi: Any, bsdf: Any, wi: NDArray[np.float64], wo: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return f cosθ, (N, 3)."""
    value = bsdf.eval(mi.BSDFContext(), at(mi, wi), vectors(mi, wo))
    return np.array(value, dtype=np.float64).T


def random_directions(count: int, seed: int) -> NDArray[np.float64]:
    points = np.random.default_rng(seed).normal(size=(count, 3))
    unit: NDArray[np.float64] = points / np.linalg.norm(points, axis=1, keepdims=True)
    return unit


def near_mirror(wi: NDArray[np.float64], spread: float, seed: int) -> NDArray[np.float64]:
    """Directions about the mirror directions of `wi`, where a narrow lobe is not black."""
    mirror = wi * (-1.0, -1.0, 1.0) + spread * random_directions(len(wi), seed)
    unit: NDArray[np.float64] = mirror / np.linalg.norm(mirror, axis=1, keepdims=True)
    return unit


def incident(degrees: float) -> NDArray[np.float64]:
    angle = np.radians(degrees)
    return np.array([[np.sin(angle), 0.0, np.cos(angle)]])


# -- the formula


@pytest.mark.parametrize("n", [0.0, 1.0, 10.0, 200.0, 1000.0])
def test_it_is_the_formula(mi: Any, n: float) -> None:
    wi = random_directions(4000, 1)
    wo = np.where(np.arange(4000)[:, None] % 2, random_directions(4000, 2), near_mirror(wi, 0.1, 3))
    f = phong(wi, wo, Z, DIFFUSE, SPECULAR, n) * wo[:, 2:]
    np.testing.assert_allclose(evaluate(mi, make(mi, n), wi, wo), f, rtol=2e-3, atol=1e-6)
    assert 500 < (f[:, 0] > 0).sum() < 2500  # the rest is seen or lit from below
    # two-sided, as scenes have it: the lower side is a mirror image of the upper
    below = phong(wi * (1, 1, -1), wo * (1, 1, -1), Z, DIFFUSE, SPECULAR, n) * -wo[:, 2:]
    both = evaluate(mi, make(mi, n, two_sided=True), wi, wo)
    np.testing.assert_allclose(both, f + below, rtol=2e-3, atol=1e-6)
    # negative control
    assert np.abs(evaluate(mi, make(mi, 1.1 * n + 0.1), wi, wo) - f).max() > 2e-3 * f.max()


@pytest.mark.parametrize("n", [0.0, 10.0, 50.0, 200.0, 1000.0])
def test_white_furnace_at_normal_incidence(mi: Any, n: float) -> None:
    """∫ (n + 2)/(2π) cosⁿθ cosθ dω = 1; the integrand is a polynomial, so Gauss has the integral itself."""
    node, weight = np.polynomial.legendre.leggauss(520)
    cosine, weight = 0.5 * (node + 1.0), 0.5 * weight
    wo = np.stack([np.sqrt(1.0 - cosine**2), 0 * cosine, cosine], axis=1)
    value = evaluate(mi, make(mi, n), np.broadcast_to(Z, wo.shape), wo)
    albedo = 2.0 * np.pi * (weight[:, None] * value).sum(axis=0)
    np.testing.assert_allclose(albedo, DIFFUSE + SPECULAR, rtol=1e-4)
    # negative control: without the cosine a normalised lobe has more than 1
    bare = 2.0 * np.pi * (weight[:, None] * value / cosine[:, None]).sum(axis=0)
    assert not np.allclose(bare - 2 * DIFFUSE, SPECULAR, rtol=5e-4)


def test_reciprocity(mi: Any) -> None:
    up = (1.0, 1.0, 1.0)
    wi = np.abs(random_directions(2000, 4)) * up
    wo = np.abs(near_mirror(wi, 0.3, 5))
    for n in (0.0, 10.0, 1000.0):
        bsdf = make(mi, n)
        there, back = (evaluate(mi, bsdf, a, b) / b[:, 2:] for a, b in ((wi, wo), (wo, wi)))
        np.testing.assert_allclose(there, back, rtol=2e-3, atol=1e-5)
        # negative control: with the cosine it is not symmetric
        assert np.abs(evaluate(mi, bsdf, wi, wo) - evaluate(mi, bsdf, wo, wi)).max() > 0.02


# -- sampling


@pytest.mark.parametrize("n", [0.0, 10.0, 1000.0])
@pytest.mark.parametrize("degrees", [0.0, 45.0, 85.0])
def test_samples_agree_with_density_and_value(mi: Any, n: float, degrees: float) -> None:
    count = 1 << 18
    wi = np.broadcast_to(incident(degrees), (count, 3))
    bsdf, ctx, si = make(mi, n), mi.BSDFContext(), at(mi, wi)
    rng = np.random.default_rng(6)
    numbers = (mi.Float(rng.random(count, np.float32)), mi.Point2f(rng.random((2, count), np.float32)))
    sample, weight = bsdf.sample(ctx, si, *numbers)
    value, pdf = bsdf.eval_pdf(ctx, si, sample.wo)
    pdf, wo, weight = np.array(pdf, dtype=np.float64), np.array(sample.wo).T, np.array(weight).T
    np.testing.assert_allclose(np.array(sample.pdf), pdf, rtol=1e-5)
    np.testing.assert_allclose(weight * pdf[:, None], np.array(value).T, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(np.array(bsdf.pdf(ctx, si, sample.wo)), pdf, rtol=1e-5)
    assert not weight[wo[:, 2] <= 0].any()
    # moments of what the samples see, by quadrature of the formula: ∫ f cosθ g dω for several g
    mean_glossy, mean_diffuse = SPECULAR.mean(), DIFFUSE.mean()
    share = mean_glossy / (mean_glossy + mean_diffuse)
    kinds = np.array(sample.sampled_component)
    assert abs((kinds == 1).mean() - share) < 0.005
    directions, measure = sphere(wi[0], n)
    f = phong(np.broadcast_to(wi[0], directions.shape), directions, Z, DIFFUSE, SPECULAR, n)
    for g in (lambda w: 1.0 + 0 * w[:, 0], lambda w: w[:, 0], lambda w: w[:, 1] ** 2, lambda w: w[:, 2]):
        exact = (f * (directions[:, 2] * g(directions) * measure)[:, None]).sum(axis=0)
        terms = weight * g(wo)[:, None]
        spread = terms.std(axis=0) / np.sqrt(count)
        assert (np.abs(terms.mean(axis=0) - exact) < 5.0 * spread + 2e-3 * np.abs(exact) + 1e-6).all()
    # negative control: samples of a lobe that is wider have another mean
    other = make(mi, 0.5 * n + 1.0).sample(ctx, si, *numbers)[0].wo
    assert abs(np.array(other).T[kinds == 1] - wo[kinds == 1]).mean() > 0.005


def sphere(wi: NDArray[np.float64], n: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Directions all around, dense about the mirror direction, and the solid angle of each."""
    mirror = wi * (-1.0, -1.0, 1.0)
    side = np.cross(mirror, (0.0, 1.0, 0.0))
    side /= np.linalg.norm(side)
    rows, columns = 1200, 240
    t = (np.arange(rows) + 0.5) / rows
    # 1 - cos α = 2 tᵏ: nearly all of a narrow lobe lies at small t
    power = 2.0 if n < 50 else 5.0
    cosine, change = 1.0 - 2.0 * t**power, 2.0 * power * t ** (power - 1.0)
    sine, phi = np.sqrt(1.0 - cosine**2), 2.0 * np.pi * (np.arange(columns) + 0.5) / columns
    other = np.cross(mirror, side)
    around = np.cos(phi)[:, None] * side + np.sin(phi)[:, None] * other
    directions = sine[:, None, None] * around + cosine[:, None, None] * mirror
    measure = np.broadcast_to((change * 2.0 * np.pi / (rows * columns))[:, None], directions.shape[:2])
    return directions.reshape(-1, 3), measure.ravel()


def test_density_by_chi_square(mi: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # a test that fails leaves a file
    make(mi, 1.0)  # registers it

    def passes(sampled: float, density: float) -> bool:
        xml = "<float name='shininess' value='{}'/>"
        sample, _ = mi.chi2.BSDFAdapter(plugins.PHONG, xml.format(sampled), wi=[0.6, 0.0, 0.8])
        _, pdf = mi.chi2.BSDFAdapter(plugins.PHONG, xml.format(density), wi=[0.6, 0.0, 0.8])
        test = mi.chi2.ChiSquareTest(mi.chi2.SphericalDomain(), sample, pdf, 3, sample_count=200_000, res=101)
        return bool(test.run())

    assert passes(10.0, 10.0)
    assert passes(40.0, 40.0)
    assert not passes(10.0, 11.5)  # negative control


@pytest.mark.parametrize("n", [0.0, 1.0, 10.0, 200.0, 1000.0])
def test_no_angle_gains_energy(mi: Any, n: float) -> None:
    """The lobe alone, of reflectance 1: its part above the horizon times the cosine never exceeds 1."""
    count = 1 << 15
    rng = np.random.default_rng(7)
    first, second = mi.Float(rng.random(count, np.float32)), mi.Point2f(rng.random((2, count), np.float32))
    bsdf = make(mi, n, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    albedos = []
    for degrees in (0.0, 20.0, 40.0, 60.0, 75.0, 85.0, 89.5):
        wi = np.broadcast_to(incident(degrees), (count, 3))
        weight = np.array(bsdf.sample(mi.BSDFContext(), at(mi, wi), first, second)[1])[0]
        albedos.append(weight.mean())
        assert albedos[-1] <= 1.0 + 3.0 * weight.std() / np.sqrt(count) + 1e-4
    assert albedos[0] == pytest.approx(1.0, abs=0.01)
    assert albedos[-1] < 0.9 * albedos[0] or n == 0.0  # negative control: not 1 at every angle
