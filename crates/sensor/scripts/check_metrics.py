"""Measures pictures with dioptric and with independent implementations: PSNR and SSIM of scikit-image, S-CIELAB in
numpy with scipy's Gaussian filters and scikit-image's color difference, the response of a slanted edge in numpy, what is weighed by the eye
with scipy's quadrature, the response of a texture (dead leaves) in numpy.

    pip install numpy scipy scikit-image
    python crates/sensor/scripts/check_metrics.py target/debug/dioptric > crates/sensor/scripts/check_metrics.txt

The pictures are made here by formula: a color texture, and the same blurred, shifted in color and with noise. The edge
is examples/scenes/edge.png, a step blurred by a Gaussian of .8 pixel, whose response is known, and so is that of the leaves, drawn here and
blurred by a Gaussian of 1.1 pixels.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.integrate import quad
from scipy.ndimage import gaussian_filter
from skimage.color import deltaE_ciede2000
from skimage.io import imread, imsave
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

ROOT = Path(__file__).resolve().parents[3]
EDGE = ROOT / "examples/scenes/edge.png"
PIXELS_PER_DEGREE = 60

# Zhang & Wandell 1997: opponent colors from XYZ, and weights and spreads (degrees) of the eye's blur of each.
OPPONENT = np.array([[0.279, 0.72, -0.107], [-0.449, 0.29, -0.077], [0.086, -0.59, 0.501]])
KERNELS = [
    [(0.921, 0.0283), (0.105, 0.133), (-0.108, 4.336)],
    [(0.531, 0.0392), (0.330, 0.494)],
    [(0.488, 0.0536), (0.371, 0.386)],
]
XYZ_FROM_SRGB = np.array([
    [0.4123907993, 0.3575843394, 0.1804807884],
    [0.2126390059, 0.7151686788, 0.0721923154],
    [0.0193308187, 0.1191947798, 0.9505321522],
])


def pictures():
    """Returns a color texture of 8-bit codes, and a copy that differs from it as pictures do."""
    row, column = np.mgrid[0:300, 0:400].astype(float)
    base = [
        0.5 + 0.2 * np.sin(column / 9 + row / 31) + 0.1 * np.sin(row / 3.1),
        0.45 + 0.2 * np.sin(column / 14 - row / 11) + 0.1 * np.cos(column / 2.3),
        0.4 + 0.25 * np.cos((column + row) / 23),
    ]
    first = np.clip(np.stack(base, axis=-1), 0, 1)
    other = gaussian_filter(first, (0.7, 0.7, 0)) * [1.03, 0.98, 1.0]
    other += np.random.default_rng(1).normal(0, 0.02, other.shape)
    return [np.round(255 * np.clip(codes, 0, 1)).astype(np.uint8) for codes in (first, other)]


def scielab(first, second):
    """Returns ΔE00 of two pictures of codes as seen by the eye."""

    def lab(codes):
        codes = codes / 255.0
        linear = np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)
        opponent = linear @ XYZ_FROM_SRGB.T @ OPPONENT.T
        seen = np.zeros_like(opponent)
        for k, kernels in enumerate(KERNELS):
            total = sum(weight for weight, _ in kernels)
            for weight, spread in kernels:
                sigma = spread * PIXELS_PER_DEGREE / np.sqrt(2)
                seen[..., k] += weight / total * gaussian_filter(opponent[..., k], sigma, mode="reflect", truncate=6)
        white = np.array([0.95047, 1.0, 1.08883])
        xyz = seen @ np.linalg.inv(OPPONENT).T / white
        f = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
        return np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], axis=-1)

    return deltaE_ciede2000(lab(first), lab(second))


def edge_response(picture, region, slope):
    """Returns the response of a slanted edge at hundredths of a cycle a pixel (ISO 12233's steps, bins of a quarter pixel)."""
    x, y, width, height = region
    part = picture[y:y + height, x:x + width].astype(float)
    # Line by line the centroid of the derivative; a straight line through them.
    derivative = np.diff(part, axis=1)
    window = np.hamming(width - 1)
    places = (derivative * window * (np.arange(width - 1) + 0.5)).sum(1) / (derivative * window).sum(1)
    fit = np.polyfit(np.arange(height), places, 1)
    distance = (np.arange(width)[None, :] - np.polyval(fit, np.arange(height))[:, None]) * np.cos(np.arctan(fit[0]))
    bins = np.floor(4 * distance).astype(int)
    low, high = np.quantile(bins, [0.02, 0.98]).astype(int)
    profile = np.array([part[bins == b].mean() for b in range(low, high)])
    lsf = np.diff(profile) * np.hamming(len(profile) - 1)
    frequency = np.arange(0, 0.505, 0.01)
    place = np.arange(len(lsf)) / 4.0
    spectrum = np.abs(np.exp(-2j * np.pi * frequency[:, None] * place[None, :]) @ lsf)
    # What the bins and the difference of neighbors take away.
    quarter = np.sinc(frequency / 4) ** 2
    return frequency, spectrum / spectrum[0] / quarter, np.degrees(np.arctan(fit[0]))


def acutance(response):
    """Returns the integral of a response (by cycles a pixel) times the eye's sensitivity over that of the sensitivity (IEEE Std 1858-2016)."""
    sensitivity = lambda nu: nu**0.8 * np.exp(-0.2 * nu)
    end = PIXELS_PER_DEGREE / 2
    seen, _ = quad(lambda nu: sensitivity(nu) * response(nu / PIXELS_PER_DEGREE), 0, end, limit=500)
    return seen / quad(sensitivity, 0, np.inf)[0]


def square_root_integral(response, picture_deg, luminance=100.0):
    """Returns Barten's square-root integral, just noticeable differences (J. Opt. Soc. Am. A 7, 1990)."""

    def sensitivity(nu):
        a = 540 * (1 + 0.7 / luminance) ** -0.2 / (1 + 12 / (picture_deg * (1 + nu / 3) ** 2))
        b = 0.3 * (1 + 100 / luminance) ** 0.15
        return a * nu * np.exp(-b * nu) * np.sqrt(1 + 0.06 * np.exp(b * nu))

    # With nu = exp(t) the integral over nu / nu is one over t.
    part = lambda t: np.sqrt(response(np.exp(t) / PIXELS_PER_DEGREE) * sensitivity(np.exp(t)))
    return quad(part, np.log(1e-12), np.log(PIXELS_PER_DEGREE / 2), limit=500)[0] / np.log(2)


def leaves(side=512, margin=24):
    """Returns dead leaves: discs of even grays, each over those before, radii by the inverse cube from 2 to 120 pixels."""
    random = np.random.default_rng(5)
    whole = side + 2 * margin
    row, column = np.mgrid[0:whole, 0:whole]
    picture, is_free = np.full((whole, whole), 0.5), np.ones((whole, whole), bool)
    # From the front: a disc shows where none has been.
    for _ in range(60000):
        radius = (2.0**-2 + random.random() * (120.0**-2 - 2.0**-2)) ** -0.5
        y, x = random.random(2) * (whole + 2 * radius) - radius
        gray = 0.25 + 0.5 * random.random()
        rows, columns = (slice(max(0, int(v - radius)), max(0, int(v + radius) + 2)) for v in (y, x))
        disc = (row[rows, columns] - y) ** 2 + (column[rows, columns] - x) ** 2 < radius**2
        picture[rows, columns][disc & is_free[rows, columns]] = gray
        is_free[rows, columns] &= ~disc
    blurred = gaussian_filter(picture, 1.1, truncate=8)
    inner = slice(margin, margin + side)
    return [np.round(65535 * plane[inner, inner]).astype(np.uint16) for plane in (picture, blurred)]


def texture_response(picture, reference):
    """Returns the mean responses over rings at multiples of 1 / side: by powers, and by cross-power over the reference's."""
    side = len(picture)
    window = np.hanning(side + 1)[:side]
    spectra = [np.fft.fft2((p - p.mean()) * np.outer(window, window)) for p in (picture / 65535, reference / 65535)]
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(side), np.fft.fftfreq(side)))
    ring = np.round(frequency * side).astype(int).ravel()
    mean = lambda values: (np.bincount(ring, values.ravel()) / np.bincount(ring))[: side // 2 + 1]
    power = mean(np.abs(spectra[1]) ** 2)
    direct = np.sqrt(mean(np.abs(spectra[0]) ** 2) / power)
    common = mean((spectra[0] * spectra[1].conj()).real) / power
    return np.arange(side // 2 + 1) / side, direct, common


def main():
    program = sys.argv[1]

    def measured(*words):
        return json.loads(subprocess.check_output([program, "measure", *map(str, words), "--json"]))

    first, second = pictures()
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / name for name in ("first.png", "second.png")]
        imsave(paths[0], first, check_contrast=False)
        imsave(paths[1], second, check_contrast=False)
        found = measured("color", paths[1], "--against", paths[0], "--pixels-per-degree", PIXELS_PER_DEGREE)
    luma = [codes / 255.0 @ [0.299, 0.587, 0.114] for codes in (first, second)]
    _, ssim = structural_similarity(
        *luma, data_range=1.0, gaussian_weights=True, sigma=1.5, truncate=4, use_sample_covariance=False, full=True)
    print(f"{'':44}{'dioptric':>12}{'independent':>14}")

    def row(name, own, other):
        print(f"{name:44}{own:12.5f}{other:14.5f}")

    row("PSNR, dB (scikit-image)", found["psnr_db"], peak_signal_noise_ratio(first, second, data_range=255))
    row("SSIM (scikit-image)", found["ssim"], ssim.mean())
    delta_e = scielab(first, second)
    row("S-CIELAB mean ΔE00 (numpy)", found["scielab"]["mean"], delta_e.mean())
    row("S-CIELAB median ΔE00", found["scielab"]["median"], np.median(delta_e))
    row("S-CIELAB 95 % ΔE00", found["scielab"]["p95"], np.quantile(delta_e, 0.95))

    edge = measured("mtf", EDGE)
    channel, region = edge["channels"][0], edge["region"]
    picture = imread(EDGE)
    region = [region[key] for key in ("column", "row", "columns", "rows")]
    frequency, response, slant = edge_response(picture, region, edge["slant_deg"])
    known = np.exp(-2 * (np.pi * 0.8 * frequency) ** 2)
    own = np.array(channel["response"])[: len(frequency)]
    row("slant of the edge, degrees", edge["slant_deg"], abs(slant))
    for at in (10, 20, 30, 40, 50):
        row(f"response at {at / 100} (known {known[at]:.5f})", own[at], response[at])
    crossing = np.argmax(response < 0.5)
    half = np.interp(0.5, response[[crossing, crossing - 1]], frequency[[crossing, crossing - 1]])
    row("MTF50, cycles a pixel", channel["mtf50_cycles_per_pixel"], half)

    # What is weighed by the eye, of the response that is known.
    gauss = lambda spread: lambda f: np.exp(-2 * (np.pi * spread * f) ** 2)
    row("acutance (scipy)", channel["acutance"], acutance(gauss(0.8)))
    picture_deg = np.sqrt(picture.size) / PIXELS_PER_DEGREE
    row("square-root integral, JND (scipy)", channel["square_root_integral_jnd"], square_root_integral(gauss(0.8), picture_deg))
    areas = [quad(gauss(0.8), first, 1)[0] for first in (0.5, 0)]
    row("aliasing share (scipy)", channel["aliasing_share"], areas[0] / areas[1])

    reference, texture = leaves()
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / name for name in ("texture.png", "reference.png")]
        imsave(paths[0], texture, check_contrast=False)
        imsave(paths[1], reference, check_contrast=False)
        found = measured("texture", paths[0], "--reference", paths[1], "--pixels-per-degree", PIXELS_PER_DEGREE)["channels"][0]
    frequency, *both = texture_response(texture, reference)
    for name, response in zip(("direct", "full_reference"), both):
        own = np.interp([0.1, 0.2, 0.3], found["frequencies_cycles_per_pixel"], found[name]["response"])
        for at, value in zip((0.1, 0.2, 0.3), own):
            row(f"texture, {name}, at {at} ({gauss(1.1)(at):.5f})", value, np.interp(at, frequency, response))
        row(f"texture, {name}, MTF50 ({np.sqrt(np.log(2) / 2) / np.pi / 1.1:.5f})", found[name]["mtf50_cycles_per_pixel"],
            np.interp(-0.5, -response[: np.argmax(response < 0.4)], frequency[: np.argmax(response < 0.4)]))
        row(f"texture, {name}, acutance (scipy)", found[name]["acutance"], acutance(gauss(1.1)))


main()
