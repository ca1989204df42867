"""The motion of a vehicle that drives: its way, its speed, and how its body nods and shakes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shotenv.world.geometry.motion import Pose
from shotenv.world.geometry.road import STRAIGHT, Curve
from shotenv.world.geometry.speed import SpeedProfile

SHAKES_FULLY_M_S = 4.0
"""Speed from which on vibration no longer grows; assumed."""


@dataclass(frozen=True)
class Body:
    """How the body of a car moves on its springs.

    Attributes
    ----------
    nod_rad_s2_m : float
        Pitch for each m/s2: braking lowers the nose, accelerating lifts it.
    tones : tuple of (frequency, heave, pitch, roll, phase)
        Vibration as a sum of tones: Hz, metres, radians, radians, radians.
    """

    nod_rad_s2_m: float = 0.0
    tones: tuple[tuple[float, float, float, float, float], ...] = ()

    def shaken(self, time_s: float) -> tuple[float, float, float]:
        """Heave in metres, pitch and roll in radians at full vibration."""
        heave = pitch = roll = 0.0
        for frequency, high, nods, leans, phase in self.tones:
            turn = math.tau * frequency * time_s + phase
            # The three differ in phase, so that the body does not only swing about one line.
            heave += high * math.sin(turn)
            pitch += nods * math.sin(turn + 2.0 * phase)
            roll += leans * math.sin(turn + 3.0 * phase)
        return heave, pitch, roll


RIGID = Body()


@dataclass(frozen=True)
class Drive:
    """A vehicle that follows a way at the speeds of a profile.

    Attributes
    ----------
    profile : SpeedProfile
    way : Curve
        From distance 0 at time 0 on.
    height_m, pitch_rad : float
        Of the camera at rest.
    body : Body
    weave_m, weave_length_m, weave_phase : float
        Sideways swing within the lane: amplitude, wavelength, phase at distance 0.
    """

    profile: SpeedProfile
    way: Curve = STRAIGHT
    height_m: float = 0.0
    pitch_rad: float = 0.0
    body: Body = RIGID
    weave_m: float = 0.0
    weave_length_m: float = 40.0
    weave_phase: float = 0.0

    def at(self, time_s: float) -> Pose:
        """Pose at `time_s`; before time 0 and after the last change of speed, too."""
        along = self.profile.distance_m(time_s)
        (x,), (y,), (heading,) = self.way.at(np.array([along]))
        wave = math.tau / self.weave_length_m
        turn = wave * along + self.weave_phase
        # From where it is at distance 0, so that every drive starts on the middle of its lane.
        aside = self.weave_m * (math.sin(turn) - math.sin(self.weave_phase))
        drift = math.atan(self.weave_m * wave * math.cos(turn))
        gear = 1.0 if along < self.way.reverse_from_m else -1.0
        shake = min(1.0, abs(self.profile.speed_m_s(time_s)) / SHAKES_FULLY_M_S)
        heave, pitch, roll = (shake * part for part in self.body.shaken(time_s))
        nod = -self.body.nod_rad_s2_m * gear * self.profile.acceleration_m_s2(time_s)
        return Pose(
            (
                float(x) - aside * math.sin(heading),
                float(y) + aside * math.cos(heading),
                self.height_m + heave,
            ),
            float(heading) + drift,
            self.pitch_rad + nod + pitch,
            roll,
        )
