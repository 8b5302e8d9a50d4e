"""Where the electron of a hydrogen atom is: |ψ|² of a real orbital, in closed form.

Textbook solution of the Schrödinger equation (e.g. Griffiths, "Introduction to Quantum
Mechanics", §4.2) with real spherical harmonics; one millimetre stands for one Bohr radius.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volviz.errors import UsageError
from volviz.model.volume import Volume
from volviz.progress import Progress
from volviz.samples.closed_form import Field, Floats, Function, sampled

QUANTUM_NUMBERS = (4, 2, 0)
"""n, l, m of the sample: two shells, a ring in each waist."""
REACH = 36.0


def orbital(size: int | None, seed: int, progress: Progress) -> Volume:
    """float32[z, y, x] probability per Bohr radius³, `size` samples along each axis (128)."""
    del seed
    count = 128 if size is None else size
    step = 2 * REACH / count
    axis = ((np.arange(count) - (count - 1) / 2) * step).astype(np.float64)
    return Volume.from_array(
        sampled(truth(), (axis, axis, axis), progress),
        (step,) * 3,
        (float(axis[0]),) * 3,
        name="orbital",
        value_unit="1/bohr³",
        length_unit=None,
        fields={"quantum numbers n, l, m": ", ".join(map(str, QUANTUM_NUMBERS))},
    )


def truth(size: int | None = None) -> Function:
    """The density that the sample shows."""
    del size
    return hydrogen(*QUANTUM_NUMBERS)


def hydrogen(n: int, l: int, m: int) -> Function:  # noqa: E741
    """|ψ|²(x, y, z) for quantum numbers n, l, m, in a₀⁻³, positions in a₀.

    m ≥ 0 gives the orbital with cos(mφ), m < 0 the one with sin(|m|φ). Raises UsageError for
    numbers that no orbital has.
    """
    norm, order = _norm(n, l, m), abs(m)

    def density(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> NDArray[np.float64]:
        x, y, z = (np.asarray(v, float) for v in (x, y, z))
        r = np.sqrt(x * x + y * y + z * z)
        rho = 2 * r / n
        cosine = z / np.maximum(r, 1e-300)
        azimuth = np.arctan2(y, x)
        wave = np.cos(m * azimuth) if m >= 0 else np.sin(order * azimuth)
        radial = np.exp(-rho) * rho ** (2 * l) * _laguerre(n - l - 1, 2 * l + 1, rho) ** 2
        return norm * radial * (_legendre(l, order, cosine) * wave) ** 2

    return density


def field(volume: Volume) -> Field:
    """The density and its gradient."""
    del volume
    return hydrogen_field(*QUANTUM_NUMBERS)


def hydrogen_field(n: int, l: int, m: int) -> Field:  # noqa: E741
    """`hydrogen` with its gradient.

    ψ is a function of r times a polynomial of degree l in x, y, z (a solid harmonic), so nothing is
    singular on the axis. Raises UsageError as `hydrogen` does.
    """
    norm, order = _norm(n, l, m), abs(m)
    whole = np.polynomial.legendre.leg2poly([0] * l + [1])
    zonal: Floats = np.asarray(np.polynomial.polynomial.polyder(whole, order))

    def density(points: Floats) -> tuple[Floats, Floats]:
        z, r = points[:, 2], np.linalg.norm(points, axis=1)
        radial, falling = _radial(n, l, r)
        along, steeper = _homogeneous(zonal, z, r)
        ring = (points[:, 0] + 1j * points[:, 1]) ** max(order - 1, 0)
        turned = ring * (points[:, 0] + 1j * points[:, 1]) if order else np.ones(len(z))
        across = order * np.stack([ring, 1j * ring], axis=1)
        wave, sides = (turned.real, across.real) if m >= 0 else (turned.imag, across.imag)
        psi = radial * along * wave
        slope = (falling * along * wave)[:, None] * points
        slope += (radial * wave)[:, None] * (steeper[0][:, None] * points)
        slope[:, :2] += (radial * along)[:, None] * sides
        slope[:, 2] += radial * wave * steeper[1]
        scale = norm * (2 / n) ** (2 * l)
        return scale * psi**2, 2 * scale * psi[:, None] * slope

    return density


def _norm(n: int, l: int, m: int) -> float:  # noqa: E741
    if not (n > l >= 0 and abs(m) <= l):
        raise UsageError(
            f"no orbital has n, l, m = {n}, {l}, {m}", fix="n > l ≥ 0 and |m| ≤ l", field="orbital"
        )
    order = abs(m)
    radial = (2 / n) ** 3 * math.factorial(n - l - 1) / (2 * n * math.factorial(n + l))
    angular = (2 * l + 1) * math.factorial(l - order) / (4 * np.pi * math.factorial(l + order))
    return radial * angular * (1 if m == 0 else 2)


def _radial(n: int, l: int, r: Floats) -> tuple[Floats, Floats]:  # noqa: E741
    """e^(−r/n) L(2r/n), and its derivative by r divided by r."""
    rho, k, a = 2 * r / n, n - l - 1, 2 * l + 1
    decay, shells = np.exp(-rho / 2), _laguerre(k, a, rho)
    slope = -_laguerre(k - 1, a + 1, rho) if k else np.zeros_like(rho)
    change = decay * (slope * 2 / n - shells / n)
    return decay * shells, change / np.maximum(r, 1e-300)


def _homogeneous(
    coefficients: Floats, z: Floats, r: Floats
) -> tuple[Floats, tuple[Floats, Floats]]:
    """Σ cₖ zᵏ r^(d−k), d the degree, whose powers of r are even; its derivatives by r divided by
    r, and by z."""
    degree = len(coefficients) - 1
    value, by_r, by_z = np.zeros_like(z), np.zeros_like(z), np.zeros_like(z)
    for k in range(degree % 2, degree + 1, 2):
        c, even = float(coefficients[k]), degree - k
        value += c * z**k * r**even
        if even:
            by_r += c * even * z**k * r ** (even - 2)
        if k:
            by_z += c * k * z ** (k - 1) * r**even
    return value, (by_r, by_z)


def _laguerre(k: int, a: int, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Generalised Laguerre polynomial L_k^(a), by its recurrence."""
    before, now = np.zeros_like(x), np.ones_like(x)
    for i in range(k):
        before, now = now, ((2 * i + 1 + a - x) * now - (i + a) * before) / (i + 1)
    return now


def _legendre(l: int, m: int, t: NDArray[np.float64]) -> NDArray[np.float64]:  # noqa: E741
    """Associated Legendre function P_l^m without the Condon–Shortley sign, by its recurrence."""
    now = np.ones_like(t) * math.prod(range(1, 2 * m, 2)) * np.maximum(1 - t * t, 0) ** (m / 2)
    before = np.zeros_like(t)
    for i in range(m, l):
        before, now = now, ((2 * i + 1) * t * now - (i + m) * before) / (i - m + 1)
    return now
