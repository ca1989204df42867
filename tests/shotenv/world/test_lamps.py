"""Lamps in band: what a lumen of each kind gives at 940 nm, and what places draw of it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shotenv.world.families import construction, garage, roads, traffic, tunnel, warehouse
from shotenv.world.geometry import lights
from shotenv.world.things import buildings

PLANCK_J_S, LIGHT_M_S, BOLTZMANN_J_K = 6.62607015e-34, 299_792_458.0, 1.380649e-23
PLACES = {
    "head lamps": lights.LOW_BEAM,
    "tail lamps": traffic.TAIL_LAMPS,
    "street": traffic.STREET_LIGHTING,
    "garage": garage.GARAGE_LIGHTING,
    "tunnel": tunnel.TUNNEL_LIGHTING,
    "warehouse": warehouse.HIGH_BAY_LIGHTING,
    "flood lights": construction.FLOOD_LIGHTING,
    "shops": roads.SHOP_LIGHTING,
    "rooms": buildings.ROOM_LIGHTING,
}


def planck(wavelength_nm, temperature_k):
    """Radiance of a black body per wavelength, up to a constant."""
    wavelength_m = wavelength_nm * 1e-9
    exponent = PLANCK_J_S * LIGHT_M_S / (wavelength_m * BOLTZMANN_J_K * temperature_k)
    return wavelength_m**-5 / np.expm1(exponent)


def photopic(wavelength_nm):
    """CIE's luminosity of 1931 in the analytic form of Wyman, Sloan and Shirley (2013)."""

    def lobe(mean, below, above):
        return np.exp(
            -0.5 * ((wavelength_nm - mean) * np.where(wavelength_nm < mean, below, above)) ** 2
        )

    return 0.821 * lobe(568.8, 0.0213, 0.0247) + 0.286 * lobe(530.9, 0.0613, 0.0322)


@pytest.mark.parametrize(("kind", "kelvin"), [("halogen", 3000.0), ("incandescent", 2700.0)])
def test_filaments_follow_planck(kind, kelvin):
    band, visible = np.arange(925.0, 955.01, 0.1), np.arange(380.0, 780.01, 0.1)
    power = np.trapezoid(planck(band, kelvin), band)
    lumens = 683.0 * np.trapezoid(photopic(visible) * planck(visible, kelvin), visible)
    assert lights.IN_BAND_W_PER_LM[kind] == pytest.approx(power / lumens, rel=0.02)


def test_leds_give_least_and_filaments_most():
    falling = ("incandescent", "halogen", "metal_halide", "sodium", "fluorescent", "led")
    power = [lights.IN_BAND_W_PER_LM[kind] for kind in falling]
    assert power == sorted(power, reverse=True)
    assert set(falling) == lights.IN_BAND_W_PER_LM.keys()
    assert power[1] > 500 * power[-1]


@pytest.mark.parametrize("place", PLACES)
def test_lamps_of_places_are_of_known_kinds_in_their_shares(place):
    lighting, rng = PLACES[place], np.random.default_rng(0)
    assert sum(lighting.shares.values()) == pytest.approx(1.0)
    drawn = [lighting.draw_kind(rng) for _ in range(2000)]
    for kind, share in lighting.shares.items():
        assert drawn.count(kind) / 2000 == pytest.approx(share, abs=0.05)
    low, high = (amount * lights.IN_BAND_W_PER_LM[kind] for amount in lighting.amount)
    one = replace(lighting, shares={kind: 1.0})
    assert all(low <= one.draw_in_band(rng) <= high for _ in range(100))


def test_a_head_lamp_s_flux_is_all_within_its_cone(monkeypatch):
    """Flux of the smooth step that `Lamp` describes, by numerical integration over its cone."""
    one_lumen = lights.Lighting((700.0, 700.0), {"halogen": 1.0})
    monkeypatch.setattr(lights, "LOW_BEAM", one_lumen)
    cutoff = math.cos(0.45)
    cosine = np.linspace(cutoff, 1.0, 10001)
    t = (cosine - cutoff) / (1 - cutoff)
    solid_angle = 2 * np.pi * np.trapezoid(t * t * (3 - 2 * t), cosine)
    intensity = lights.low_beam_intensity(np.random.default_rng(0), cutoff)
    assert intensity * solid_angle == pytest.approx(700.0 * 9.8e-4, rel=1e-6)


def test_the_ego_has_two_like_head_lamps_of_either_kind():
    intensity = []
    for seed in range(200):
        left, right = lights.ego_headlights(np.random.default_rng(seed))
        assert left.intensity_w_sr == right.intensity_w_sr
        intensity.append(left.intensity_w_sr)
    halogen = np.array(intensity) > 0.1
    # LED and halogen ones are hundreds of times apart, with none between.
    assert np.array(intensity)[~halogen].max() < 0.01 and np.array(intensity)[halogen].min() > 1.0
    assert halogen.mean() == pytest.approx(0.5, abs=0.1)


def test_red_covers_let_the_infrared_of_bulbs_through(monkeypatch):
    """A red lamp of 5 cd is a bulb of 25 cd, all of whose infrared comes out."""
    for kind, bulb_cd in (("incandescent", 25.0), ("led", 5.0)):
        monkeypatch.setattr(traffic, "TAIL_LAMPS", lights.Lighting((5.0, 5.0), {kind: 1.0}))
        expected = bulb_cd * lights.IN_BAND_W_PER_LM[kind] / traffic.TAIL_LAMP_M2
        assert traffic.tail_radiance(np.random.default_rng(0)) == pytest.approx(expected)
