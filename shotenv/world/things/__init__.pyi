from . import (
    animals as animals,
    buildings as buildings,
    cycles as cycles,
    furniture as furniture,
    people as people,
    plants as plants,
    shelters as shelters,
    vehicles as vehicles,
)
from .heavy import cab as cab, nose_lamps as nose_lamps
from .wheels import axle as axle
