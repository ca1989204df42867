from . import (
    construction as construction,
    enclosed as enclosed,
    forest as forest,
    roads as roads,
    snow as snow,
    warehouse as warehouse,
)
