from .settings import SETTINGS as SETTINGS, Place as Place
