"""One photograph against a single-image method: colour Retinex, as Grosse, Johnson, Adelson and Freeman describe it (Ground
truth dataset and baseline evaluations for intrinsic image algorithms, ICCV 2009, section 4.1), written from the paper.

A step of the logarithm between two neighbouring pixels belongs to reflectance where the step of chromaticity, or of
brightness, is above a threshold, and to shading elsewhere; brightness of reflectance is what has these steps in the least
squares; shading is grey. The thresholds are those of a grid that bring it nearest to the truth of this very picture, which
no user could choose: the method at its best. A single picture does not tell how bright light is, nor its colour, so each base
colour is compared at the factors of red, green and blue that bring it nearest; ours also as it is.

usage: retinex.py PHOTOGRAPH.exr TRUTH.exr OURS.exr PICTURE.png: prints rows of a table, and writes the photograph, Retinex's
reflectance, ours and the truth beside each other."""
import sys

import numpy as np
import OpenEXR
from PIL import Image

THRESHOLDS = [0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6]  # steps of the natural logarithm
DARK = 1e-4  # of the mean: what is darker counts as this
GAP = 8  # pixels


def channels(path):
    with OpenEXR.File(path, separate_channels=True) as file:
        return {name: c.pixels.astype(np.float64) for name, c in file.channels().items()}


def colour(found, prefix=""):
    return np.stack([found[prefix + c] for c in "RGB"], axis=-1)


def integrate(across, down):
    """The picture whose steps to the right and down are nearest to these (least squares, free borders), by the FFT of
    the picture mirrored at its borders."""
    height, width = across.shape[0], down.shape[1]
    divergence = np.zeros((height, width))
    divergence[:, :-1] += across
    divergence[:, 1:] -= across
    divergence[:-1] += down
    divergence[1:] -= down
    mirrored = np.block([[divergence, divergence[:, ::-1]], [divergence[::-1], divergence[::-1, ::-1]]])
    x = 2.0 * np.cos(np.pi * np.arange(2 * width) / width) - 2.0
    y = 2.0 * np.cos(np.pi * np.arange(2 * height) / height) - 2.0
    eigenvalue = y[:, None] + x[None, :]
    eigenvalue[0, 0] = 1.0
    spectrum = np.fft.fft2(mirrored) / eigenvalue
    spectrum[0, 0] = 0.0
    return -np.fft.ifft2(-spectrum).real[:height, :width]


def retinex(photograph, of_brightness, of_chromaticity):
    log = np.log(np.maximum(photograph, DARK * photograph.mean()))
    brightness = log.mean(axis=2)
    chromaticity = log - brightness[..., None]
    steps = []
    for axis in (1, 0):
        step = np.diff(brightness, axis=axis)
        hue = np.sqrt((np.diff(chromaticity, axis=axis) ** 2).sum(axis=2))
        steps.append(np.where((np.abs(step) > of_brightness) | (hue > of_chromaticity), step, 0.0))
    return np.exp(integrate(*steps)[..., None] + chromaticity)


def psnr(found, truth, counts):
    error = (np.clip(found, 0.0, 1.0) - truth)[counts]
    return -10.0 * np.log10((error**2).mean())


def scaled(found, truth, counts):
    """At the factors of red, green and blue that bring it nearest; clipped values make that a search."""
    result = np.empty_like(found)
    for c in range(3):
        own, wanted = found[..., c], truth[..., c]
        factors = np.exp(np.linspace(-2.0, 2.0, 161)) * wanted[counts].mean() / max(own[counts].mean(), 1e-9)
        result[..., c] = own * max(factors, key=lambda f: psnr(f * own, wanted, counts))
    return result


def shown(linear):
    v = np.clip(linear, 0.0, 1.0)
    return np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)


def main(photograph_path, truth_path, ours_path, picture_path):
    photograph = colour(channels(photograph_path))
    record = channels(truth_path)
    truth, ours = colour(record, "base_color."), colour(channels(ours_path))
    counts = (record["object_id"] >= 0.0) & (colour(record, "emission.").max(axis=2) == 0.0)
    best = None
    for b in THRESHOLDS:
        for c in THRESHOLDS:
            found = scaled(retinex(photograph, b, c), truth, counts)
            if best is None or psnr(found, truth, counts) > best[0]:
                best = (psnr(found, truth, counts), b, c, found)
    rows = [("colour Retinex at its best thresholds and white balance", best[0]),
            ("ours at its best white balance", psnr(scaled(ours, truth, counts), truth, counts)),
            ("ours", psnr(ours, truth, counts))]
    for what, value in rows:
        print(f"Fig. 4, one photograph: base colour PSNR, dB: {what}\t{value:.4g}\t-\thigher")
    print(f"thresholds: brightness {best[1]}, chromaticity {best[2]}", file=sys.stderr)
    exposure = 0.6 / np.quantile(photograph.mean(axis=2), 0.8)
    gap = np.ones((photograph.shape[0], GAP, 3))
    tiles = [shown(exposure * photograph), gap, shown(best[3]), gap, shown(ours), gap, shown(truth)]
    Image.fromarray((255.0 * np.concatenate(tiles, axis=1) + 0.5).astype(np.uint8)).save(picture_path)


main(*sys.argv[1:])
