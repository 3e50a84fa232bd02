# SPDX-License-Identifier: GPL-3.0-or-later
"""Refraction, reflection, Fresnel and attenuation: the float64 twin of `gpu_shaders/optics_lib.glsl`.

Vectors are arrays (..., 3); N is the unit normal from the water to the air, E the unit
vector from the surface to the camera and I = -E the incident direction.
"""

from __future__ import annotations

import numpy as np

MIN_COSINE = 1e-3
"""Least E.N used: a wave's far side, seen edge on between two vertices, has none that is positive."""

MIN_RISE = 1e-3
"""Least z of a reflected direction: steeper waves would send it into the neighbouring wave."""


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.sum(a * b, axis=-1, keepdims=True)


def face_viewer(normal: np.ndarray, to_eye: np.ndarray) -> np.ndarray:
    """The normal, turned just as far towards the eye as makes E.N at least MIN_COSINE; unit."""
    cosine = _dot(to_eye, normal)
    turned = normal + np.maximum(MIN_COSINE - cosine, 0.0) * to_eye
    return turned / np.linalg.norm(turned, axis=-1, keepdims=True)


def refract_direction(incident: np.ndarray, normal: np.ndarray, n12: float) -> tuple[np.ndarray, np.ndarray]:
    """Refracted unit direction and whether there is one (eq. 2 of the thesis).

    s = 1 - n12^2 (1 - (N.I)^2); R = n12 I - (n12 N.I + sqrt(s)) N, with N on the side
    that I comes from. Where s < 0 (total internal reflection) the direction is 0.
    """
    cosine = _dot(normal, incident)
    s = 1.0 - n12 * n12 * (1.0 - cosine * cosine)
    exists = s >= 0.0
    direction = n12 * incident - (n12 * cosine + np.sqrt(np.maximum(s, 0.0))) * normal
    return np.where(exists, direction, 0.0), exists[..., 0]


def reflect_direction(incident: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """R = I - 2 (N.I) N."""
    return incident - 2.0 * _dot(normal, incident) * normal


def reflect_upwards(incident: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """The reflected direction with its z turned up, at least MIN_RISE.

    A ray that a steep wave reflects downwards meets the water again; the second
    reflection is taken on the flat surface, which turns the z around. Unit.
    """
    r = reflect_direction(incident, normal)
    r = np.concatenate([r[..., :2], np.maximum(np.abs(r[..., 2:]), MIN_RISE)], axis=-1)
    return r / np.linalg.norm(r, axis=-1, keepdims=True)


def reflectance_at_normal(n12: float) -> float:
    """f = ((1 - n12) / (1 + n12))^2; 0.0204 for 0.75."""
    return ((1.0 - n12) / (1.0 + n12)) ** 2


def schlick(cosine: np.ndarray, f: float, q: float) -> np.ndarray:
    """F = f + (1 - f) (1 - E.N)^q, cosine clamped to [0, 1]."""
    return f + (1.0 - f) * np.power(1.0 - np.clip(cosine, 0.0, 1.0), q)


def fresnel_dielectric(cosine: np.ndarray, n12: float) -> np.ndarray:
    """Reflectance of unpolarised light at a surface between two dielectrics, by Fresnel's equations.

    cosine: of the angle of incidence, clamped to [0, 1]; n12: refractive index on the side that the light
    comes from over that of the other. 1 where there is total internal reflection.
    """
    cosine = np.clip(cosine, 0.0, 1.0)
    # 1 - n12^2 (1 - cosine^2) without its cancellation at n12 = 1.
    s = (1.0 - n12) * (1.0 + n12) + (n12 * cosine) ** 2
    passes = s > 0.0
    beyond = np.sqrt(np.where(passes, s, 0.0))  # cosine of the angle of refraction
    across, along = n12 * cosine + beyond, n12 * beyond + cosine
    s_polarised = (n12 * cosine - beyond) / np.where(passes, across, 1.0)
    p_polarised = (n12 * beyond - cosine) / np.where(passes, along, 1.0)
    return np.where(passes, 0.5 * (s_polarised**2 + p_polarised**2), 1.0)


def _over_sky(n: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gauss's nodes over the angles of light from an even sky: the part of it that each stands for, what
    passes the surface there, and the cosine of the angle of refraction."""
    nodes, weights = np.polynomial.legendre.leggauss(64)
    cosine = 0.5 * (nodes + 1.0)
    beyond = np.sqrt(1.0 - (1.0 - cosine**2) / n**2)
    return weights * cosine, 1.0 - fresnel_dielectric(cosine, 1.0 / n), beyond


def diffuse_transmittance(n: float) -> float:
    """Part of the irradiance of an even sky that passes a flat surface into a medium of refractive index n.

    Fresnel's equations over the cosine-weighted half space (Walsh 1926); 0.934 for water.
    """
    part, passed, _ = _over_sky(n)
    return float(part @ passed)


def diffuse_path(n: float) -> float:
    """m of water that the light of an even sky passes for each m of depth: the mean over what passes the
    surface, of irradiance on a level one; 1.2 for water. Exact where little is absorbed.
    """
    part, passed, beyond = _over_sky(n)
    return float(part @ (passed / beyond) / (part @ passed))


def attenuation(k: float, distance: np.ndarray) -> np.ndarray:
    """a = exp(-k d): what is left of the light after d metres of water."""
    return np.exp(-k * np.asarray(distance, dtype=np.float64))


def through_water(color: np.ndarray, water_color: np.ndarray, a: np.ndarray) -> np.ndarray:
    """C' = water_color + a (C - water_color); a broadcasts against (..., 3) colours."""
    return water_color + a * (color - water_color)


def mix_fresnel(refracted: np.ndarray, reflected: np.ndarray, fresnel: np.ndarray) -> np.ndarray:
    """C = C'_refract + F (C_reflect - C'_refract), eq. (9)."""
    return refracted + fresnel * (reflected - refracted)
